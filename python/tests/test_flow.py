"""Flows step by step."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import willmore
from conftest import circle_field, icosphere, volume
from willmore import exact

CROSS = {"cells": 24, "steps": 5}


def test_states_come_one_by_one_and_stay():
    flow = willmore.flow("builtin:cross", **CROSS)
    assert iter(flow) is flow and flow.ended is None
    states, fields = [], []
    for state in flow:
        assert state.step == len(states) + 1
        states.append(state)
        fields.append(state.field.copy())
    assert len(states) == 5 and flow.ended == "5 steps are made"
    with pytest.raises(StopIteration):
        next(flow)
    assert all(np.array_equal(state.field, field) for state, field in zip(states, fields))
    assert not np.array_equal(fields[0], fields[1])
    times, energies = [state.time for state in states], [state.energy for state in states]
    assert (np.diff(times) > 0).all() and (np.diff(energies) < 0).all()
    assert flow.start.step == 0 and flow.start.time == 0 and flow.start.energy > energies[0]
    assert states[-1].sizes["length"] < flow.start.sizes["length"]


def test_states_that_are_looked_at_late_are_the_same():
    early = [state.field for state in willmore.flow("builtin:cross", **CROSS)]
    late = list(willmore.flow("builtin:cross", **CROSS))
    assert all(np.array_equal(state.field, field) for state, field in zip(late, early))


def test_result_and_metrics():
    flow = willmore.flow("builtin:cross", **CROSS)
    states = [next(flow), next(flow)]
    assert flow.result().report["steps"] == 2
    result = flow.run()
    assert result.report["steps"] == 5 and result.ended == flow.ended == "5 steps are made"
    assert list(result.metrics["step"]) == [1, 2, 3, 4, 5]
    # The rows of the metrics are those of the states.
    for i, state in enumerate(states):
        for name in ("time", "tau", "objective_before", "objective", "energy", "area", "length", "newton", "hvp"):
            assert result.metrics[name][i] == state.record[name]
    assert result.metrics["objective"][0] <= result.metrics["objective_before"][0]
    assert result.report["energy"] == result.metrics["energy"][-1] > 0 and states[1].energy == result.metrics["energy"][1]
    assert flow.start.energy == result.report["first_energy"]
    assert np.array_equal(result.field, willmore.flow("builtin:cross", **CROSS).run().field)


def test_a_circle_grows_as_it_must():
    field, _ = circle_field(cells=96, spacing=0.05)
    flow = willmore.flow(field, spacing=0.05, origin=(5, 7), time=0.5, tolerance="0.5%")
    assert flow.start.sizes["area"] == pytest.approx(np.pi * 1.2**2, rel=1e-3)
    for state in flow:
        radius = exact.circle_radius(1.2, state.time)
        assert np.sqrt(state.sizes["area"] / np.pi) == pytest.approx(radius, rel=2e-3)
        assert state.sizes["length"] == pytest.approx(2 * np.pi * radius, rel=2e-3)
    assert state.time == pytest.approx(0.5) and radius > 1.3
    assert np.sqrt(state.sizes["area"] / np.pi) - 1.2 == pytest.approx(radius - 1.2, rel=0.02)
    assert state.energy == pytest.approx(np.pi / radius, rel=0.01)


def test_fields_have_a_place():
    field, nodes = circle_field()
    state = next(willmore.flow(field, spacing=0.1, origin=[5, 7], steps=1))
    assert state.spacing == pytest.approx(0.1) and state.origin == pytest.approx([5, 7]) and state.field.shape == (48, 48)
    (curve,) = state.curves
    assert curve.shape[1] == 2 and curve.mean(axis=0) == pytest.approx([7.4, 9.4], abs=0.05)
    assert np.linalg.norm(curve - [7.4, 9.4], axis=1) == pytest.approx(1.2, abs=0.01)
    # The first axis is x.
    ellipse = np.tanh((1 - np.hypot((nodes[0] - 7.4) / 1.6, (nodes[1] - 9.4) / 0.8)) * 4)
    (curve,) = willmore.flow(ellipse, spacing=0.1, origin=(5, 7), steps=1).start.curves
    assert np.ptp(curve, axis=0) == pytest.approx([3.2, 1.6], abs=0.1)
    assert state.mesh is None
    # Without a place, nodes are 1 apart from 0.
    flow = willmore.flow(field.astype(np.float32), steps=1)
    assert flow.start.spacing == pytest.approx(1) and flow.start.origin == pytest.approx([0, 0])
    assert flow.start.sizes["area"] == pytest.approx(np.pi * 12**2, rel=1e-3)


def test_zero_levels():
    field, _ = circle_field()
    (curve,) = willmore.zero_level(field, spacing=0.1, origin=(5, 7))
    assert np.linalg.norm(curve - [7.4, 9.4], axis=1) == pytest.approx(1.2, abs=0.01)
    x, y, z = np.mgrid[:20, :20, :20] * 0.5
    mesh = willmore.zero_level(3 - np.sqrt((x - 5) ** 2 + (y - 5) ** 2 + (z - 5) ** 2), spacing=0.5, origin=1)
    assert np.linalg.norm(mesh.vertices - 6, axis=1) == pytest.approx(3, abs=0.05)
    assert volume(*mesh) == pytest.approx(36 * np.pi, rel=0.05)
    for wrong in (np.ones((5, 5)), np.ones((5, 5, 5)), np.zeros((4, 5)), np.zeros(5), np.full((5, 5, 5), np.nan), "field"):
        with pytest.raises(willmore.Error):
            willmore.zero_level(wrong)


def test_masks(square):
    flow = willmore.flow(square, cells=48, steps=2)
    assert np.array_equal(flow.start.image, square)
    image = flow.run().image
    assert image.dtype == np.bool_ and image.shape == square.shape
    # Corners have become round, and the middle of the shape is where it was.
    assert 0 < (image ^ square).sum() < 0.3 * square.sum()
    assert square[11, 16] and not image[11, 16] and image[20, 22]
    assert np.argwhere(image).mean(axis=0) == pytest.approx(np.argwhere(square).mean(axis=0), abs=0.5)
    assert np.array_equal(willmore.flow(np.asfortranarray(square), cells=48, steps=2).run().image, image)


@pytest.mark.parametrize(
    "ink, paper",
    [
        (0, 255),
        (255, 0),
        ([20, 20, 30], [220, 200, 240]),
        ([220, 200, 240], [20, 20, 30]),
        ([20, 30, 200, 255], [0, 0, 0, 0]),
        ([20, 30, 200, 255], [250, 240, 250, 255]),
    ],
)
def test_images_come_back_in_their_colours(square, ink, paper):
    ink, paper = np.array(ink, np.uint8), np.array(paper, np.uint8)
    image = np.where(square if ink.ndim == 0 else square[:, :, None], ink, paper)
    before = image.copy()
    flow = willmore.flow(image, cells=48, steps=2)
    assert np.abs(flow.start.image.astype(float) - image).mean() < 3
    result = flow.run().image
    assert result.dtype == np.uint8 and result.shape == image.shape
    assert np.array_equal(result[20, 22], ink) and np.array_equal(result[0, 0], paper)
    assert np.array_equal(image, before)
    mask = willmore.flow(square, cells=48, steps=2).run().image
    nearer = lambda pixels: np.abs(pixels.astype(float) - ink) < np.abs(pixels.astype(float) - paper)
    agree = nearer(result) if ink.ndim == 0 else nearer(result)[:, :, np.argmax(np.abs(ink.astype(float) - paper))]
    assert (agree == mask).mean() > 0.99


def test_drawings_are_written(square, tmp_path):
    result = willmore.flow(square, cells=48, steps=1).run()
    result.save(tmp_path / "curve.svg")
    result.save(tmp_path / "curve.png")
    assert "<svg" in (tmp_path / "curve.svg").read_text()
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(willmore.Error):
        result.save(tmp_path / "curve.ply")
    with pytest.raises(willmore.Error):
        result.to_trimesh()


def test_a_mesh_in_space_is_a_mesh_after_each_step():
    vertices, faces = icosphere(3)
    # An ellipsoid with the volume of the sphere of radius 1.
    flow = willmore.flow((vertices * [1.6, 0.8, 0.8], faces), volume="keep", cells=32, steps=3)
    volumes = [state.sizes["volume"] for state in flow]
    assert volumes == pytest.approx([flow.start.sizes["volume"]] * 3, rel=1e-9)
    mesh = flow.result().mesh
    assert volume(*mesh) == pytest.approx(volume(vertices * [1.6, 0.8, 0.8], faces), rel=0.03)
    assert np.ptp(mesh.vertices, axis=0)[0] < 3.2 and np.ptp(mesh.vertices, axis=0)[1] > 1.6


def test_sizes_are_held(square):
    flow = willmore.flow(square, cells=48, steps=4, area="keep")
    areas = [state.sizes["area"] for state in flow]
    assert areas == pytest.approx([flow.start.sizes["area"]] * 4, rel=1e-9)
    flow = willmore.flow(square, cells=48, steps=3, ramp=2, area="90%")
    assert flow.run().report["area"] == pytest.approx(0.9 * flow.start.sizes["area"], rel=1e-6)
    lengths = [state.sizes["length"] for state in willmore.flow(square, cells=48, steps=3, length=60.0, ramp=2)]
    assert lengths[-1] == pytest.approx(60, rel=1e-6)


def test_reduced_volume():
    field, nodes = circle_field()
    ellipse = np.tanh((1 - np.hypot((nodes[0] - 7.4) / 1.5, (nodes[1] - 9.4) / 0.9)) * 4)
    flow = willmore.flow(ellipse, spacing=0.1, origin=(5, 7), reduced_volume=0.8, ramp=4, steps=6)
    assert flow.start.sizes["reduced_volume"] > 0.85
    assert flow.run().report["reduced_volume"] == pytest.approx(0.8, abs=1e-4)


def test_energies():
    # A coarse grid has a sphere of some per cent too much.
    assert willmore.energy(icosphere(3), cells=32) == pytest.approx(8 * np.pi, rel=0.05)
    field, _ = circle_field()
    calm = willmore.flow(field, spacing=0.1, steps=2).run().field
    assert willmore.energy(calm, spacing=0.1) == pytest.approx(np.pi / 1.2, rel=0.05)
    assert willmore.energy(calm, spacing=0.2) == pytest.approx(willmore.energy(calm, spacing=0.1) / 2, rel=1e-6)


def test_two_flows_at_once_are_those_of_one_after_the_other(square):
    shapes = ["builtin:cross", square, "builtin:ring"]
    one_by_one = [willmore.flow(shape, cells=32, steps=5).run() for shape in shapes]
    results = {}

    def act(number):
        results[number] = willmore.flow(shapes[number], cells=32, steps=5).run()

    threads = [threading.Thread(target=act, args=[number]) for number in range(len(shapes))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number, expected in enumerate(one_by_one):
        assert np.array_equal(results[number].field, expected.field)
        assert np.array_equal(results[number].metrics["energy"], expected.metrics["energy"])


def test_other_threads_run_during_a_step():
    flow = willmore.flow("builtin:cube", cells=48, steps=1)
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-3)

    thread = threading.Thread(target=tick)
    thread.start()
    begun = time.perf_counter()
    next(flow)
    ended = time.perf_counter()
    done.set()
    thread.join()
    inside = [t for t in ticks if begun + 0.2 * (ended - begun) < t < begun + 0.8 * (ended - begun)]
    assert len(inside) >= 3, f"{len(inside)} ticks in {ended - begun} s"


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer of signals")
def test_a_flow_goes_on_after_ctrl_c():
    whole = [state.energy for state in willmore.flow("builtin:cross", cells=64, steps=8)]
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        flow = willmore.flow("builtin:cross", cells=64, steps=8)
        energies, interruptions = {}, 0
        while flow.ended is None:
            try:
                signal.setitimer(signal.ITIMER_REAL, 0.01)
                for state in flow:
                    energies[state.step] = state.energy
            except KeyboardInterrupt:
                interruptions += 1
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert interruptions > 0
    # A step whose state was not taken is complete all the same.
    assert all(energies[step] == whole[step - 1] for step in energies)
    assert list(flow.result().metrics["energy"]) == whole


@pytest.mark.skipif(os.name == "nt", reason="no signals of this kind")
def test_ctrl_c_ends_long_work():
    script = """
import signal, time, willmore
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 1.0)
begun = time.perf_counter()
try:
    willmore.inpaint("builtin:cross", "box:-0.2,-0.2,0.7,0.2", ansatz="empty", cells=64, steps=100000)
except KeyboardInterrupt:
    print("interrupted", time.perf_counter() - begun)
print(willmore.flow("builtin:cross", cells=24, steps=1).run().report["steps"])
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    first, second = done.stdout.splitlines()
    assert first.startswith("interrupted") and float(first.split()[1]) < 20 and second == "1"


def test_progress_is_told_and_can_stop(noisy):
    told = []
    willmore.fair(noisy, cells=24, steps=2, progress=lambda *what: told.append(what))
    assert told and all(isinstance(title, str) and done <= parts for title, done, parts in told)
    assert told[-1][1:] == (2, 2)

    def stop(title, done, parts):
        raise signal.raise_signal(signal.SIGINT) or ZeroDivisionError

    with pytest.raises((KeyboardInterrupt, ZeroDivisionError)):
        willmore.fair(noisy, cells=24, steps=2, progress=stop)
    with pytest.raises(ZeroDivisionError):
        willmore.fair(noisy, cells=24, steps=2, progress=lambda *what: 1 / 0)


def test_progress_is_shown(capsys):
    willmore.inpaint("builtin:cross", "box:-0.2,-0.2,0.7,0.2", cells=24, steps=2, progress=True)
    assert capsys.readouterr().err


@pytest.mark.parametrize(
    "shape, options",
    [
        (np.zeros((0, 0)), {}),
        (np.zeros((0, 0), bool), {}),
        (np.zeros((1, 1)), {}),
        (np.zeros((40, 40)), {}),
        (np.ones((40, 40)), {}),
        (np.full((40, 40), np.nan), {}),
        (np.zeros((40, 40), bool), {}),
        (np.ones((40, 40), bool), {}),
        (np.zeros((40, 40), np.uint8), {}),
        (np.zeros((40, 40, 5), np.uint8), {}),
        (np.zeros((30, 40)), {}),
        (np.zeros((40, 40), int), {}),
        (np.zeros((4, 4, 4), bool), {}),
        (np.zeros(4), {}),
        ([[1.0], [2.0, 3.0], [4.0]], {}),
        (circle_field()[0], {"spacing": 0}),
        (circle_field()[0], {"spacing": (0.1, 0.2)}),
        (circle_field()[0], {"spacing": np.nan}),
        (circle_field()[0], {"origin": (1, 2, 3)}),
        (circle_field()[0], {"origin": np.inf}),
        (circle_field()[0], {"stepps": 3}),
        (circle_field()[0], {"frames": 1}),
    ],
)
def test_refused(shape, options):
    with pytest.raises(willmore.Error) as refused:
        willmore.flow(shape, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("place", [{"spacing": 0.1}, {"origin": (0, 0)}])
def test_only_a_field_that_is_an_array_has_a_place(square, sphere, place, tmp_path):
    for shape in ("builtin:cross", square, square.astype(np.uint8), sphere):
        for act in (
            lambda: willmore.flow(shape, **place),
            lambda: willmore.energy(shape, **place),
            lambda: willmore.inpaint(shape, "ball:0,0,0.1", **place),
            lambda: willmore.Run.start("flow", shape, tmp_path / "run", **place),
        ):
            with pytest.raises(willmore.Error, match="`spacing` and `origin`"):
                act()
