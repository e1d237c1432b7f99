"""The functions give what the program gives, to the last bit."""

import subprocess
import sys

import nibabel
import numpy as np
import pytest
import willmore
from skimage.io import imread, imsave


def program(*arguments, code=0):
    """Calls the program, and returns what it prints."""
    script = "import sys; from willmore._program import main; main()"
    command = [sys.executable, "-c", script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def write_ply(path, vertices, faces):
    """An ASCII file whose numbers are read as they are."""
    lines = [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()] + [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
    path.write_text(head + f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n" + "\n".join(lines) + "\n")


def same_metrics(run, result):
    """All columns of the program are in the result."""
    assert len(run.metrics["step"]) == len(result.metrics["step"])
    for name, column in run.metrics.items():
        if name in result.metrics:
            assert np.array_equal(result.metrics[name], column, equal_nan=True), name
        else:
            assert np.isnan(column).all(), name


def same_report(run, result):
    """All but the number of cells that happen to be stored, and what a folder has."""
    for name in ("steps", "time", "energy", "first_energy", "area", "grid"):
        assert result.report[name] == run.report[name], name


def test_fair(noisy, tmp_path):
    write_ply(tmp_path / "scan.ply", *noisy)
    program("fair", tmp_path / "scan.ply", "--cells", 24, "--output", tmp_path / "run")
    run, result = willmore.Run.open(tmp_path / "run"), willmore.fair(noisy, cells=24)
    assert run.finished
    assert np.array_equal(run.mesh.vertices, result.mesh.vertices) and np.array_equal(run.mesh.faces, noisy[1])
    assert np.array_equal(run.field, result.field)
    same_metrics(run, result)
    same_report(run, result)


def test_fair_with_options(noisy, tmp_path):
    write_ply(tmp_path / "scan.ply", *noisy)
    options = "--cells 24 --steps 2 --volume keep --keep box:-2,-2,0.3,2,2,2".split()
    program("fair", tmp_path / "scan.ply", *options, "--output", tmp_path / "run")
    result = willmore.fair(noisy, cells=24, steps=2, fixed="box:-2,-2,0.3,2,2,2")
    assert np.array_equal(willmore.Run.open(tmp_path / "run").mesh.vertices, result.mesh.vertices)


def test_surfaces(ball, tmp_path):
    affine = np.array([[2, 0.5, 0, 10], [0, 1.5, 0.25, -20], [0.25, 0, 1, 5], [0, 0, 0, 1]])
    nibabel.save(nibabel.Nifti1Image(ball.astype(np.uint8) * 2, affine), tmp_path / "labels.nii.gz")
    program("fair", tmp_path / "labels.nii.gz", "--label", 2, "--cells", 24, "--steps", 1, "--output", tmp_path / "run")
    run, result = willmore.Run.open(tmp_path / "run"), willmore.surfaces(nibabel.load(tmp_path / "labels.nii.gz"), cells=24, steps=1)[2]
    assert np.array_equal(run.mesh.vertices, result.mesh.vertices) and np.array_equal(run.mesh.faces, result.mesh.faces)
    assert np.array_equal(run.field, result.field)
    same_report(run, result)


@pytest.mark.parametrize("kind", [bool, np.uint8])
def test_flow_of_an_image(square, tmp_path, kind):
    imsave(tmp_path / "drawing.png", np.where(square, 0, 255).astype(np.uint8), check_contrast=False)
    program("flow", tmp_path / "drawing.png", "--cells", 48, "--steps", 3, "--output", tmp_path / "run")
    image = square if kind is bool else imread(tmp_path / "drawing.png")
    run, result = willmore.Run.open(tmp_path / "run"), willmore.flow(image, cells=48, steps=3).run()
    assert np.array_equal(run.field, result.field) and run.mesh is None
    same_metrics(run, result)
    same_report(run, result)
    result.save(tmp_path / "curve.png")
    assert (tmp_path / "curve.png").read_bytes() == (tmp_path / "run" / "final.png").read_bytes()
    picture = imread(tmp_path / "run" / "final.png")[:, :, 0]
    assert np.array_equal(result.image, picture < 128 if kind is bool else picture)


def test_flow_of_a_shape_in_space(tmp_path):
    options = {"volume": "keep", "tau": "doubling:1e-6", "spontaneous_curvature": 0.5}
    program("flow", "builtin:cube", "--cells", 24, "--steps", 3, "--output", tmp_path / "run", "--save", tmp_path / "mesh.ply",
            *[f"--{name.replace('_', '-')}={value}" for name, value in options.items()])  # fmt: skip
    run, result = willmore.Run.open(tmp_path / "run"), willmore.flow("builtin:cube", cells=24, steps=3, **options).run()
    assert np.array_equal(run.field, result.field)
    assert np.array_equal(run.mesh.vertices, result.mesh.vertices)
    same_metrics(run, result)
    result.save(tmp_path / "result.ply")
    assert (tmp_path / "result.ply").read_bytes() == (tmp_path / "mesh.ply").read_bytes()


def test_flow_of_a_field(tmp_path):
    x, y = (np.mgrid[:32, :32] + 0.5) / 16 - 1
    field = np.tanh((0.5 - np.hypot(x, 1.5 * y)) * 8)
    np.save(tmp_path / "field.npy", field)
    program("flow", tmp_path / "field.npy", "--steps", 2, "--output", tmp_path / "run")
    run, result = willmore.Run.open(tmp_path / "run"), willmore.flow(field, spacing=1 / 16, origin=-1, steps=2).run()
    assert np.array_equal(run.field, result.field)
    same_metrics(run, result)


def test_inpaint(square, tmp_path):
    hole = np.zeros_like(square)
    hole[24:34, 12:34] = True
    image = np.where(square, np.uint8(40), np.uint8(230))
    imsave(tmp_path / "drawing.png", image, check_contrast=False)
    imsave(tmp_path / "mask.png", np.where(hole, 0, 255).astype(np.uint8), check_contrast=False)
    options = "--ansatz empty --cells 48 --steps 3".split()
    program("inpaint", tmp_path / "drawing.png", "--mask", tmp_path / "mask.png", *options, "--output", tmp_path / "run")
    run, result = willmore.Run.open(tmp_path / "run"), willmore.inpaint(image, hole, ansatz="empty", cells=48, steps=3)
    assert np.array_equal(run.field, result.field)
    assert np.array_equal(imread(tmp_path / "run" / "final.png")[:, :, 0], result.image)
    same_metrics(run, result)


def test_exit_codes(tmp_path):
    assert willmore.__version__ in program("--version")
    assert "flow" in program("--help")
    assert "missing.ply" in program("flow", tmp_path / "missing.ply", code=2)
    assert "--celsl" in program("flow", "builtin:cross", "--celsl", 3, code=2)


def files(folder):
    """All files of a run but those that say how long it took."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name not in ("timings.json", "lock")
    }


def interrupted(folder, after, **options):
    """A run that ends by Ctrl-C."""

    def stop(title, done, parts):
        if done == after and parts == options["steps"]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        willmore.Run.start("flow", "builtin:cross", folder, progress=stop, **options)
    return willmore.Run.open(folder)


@pytest.mark.parametrize("by_program", [False, True])
def test_an_interrupted_run_ends_with_the_same_bytes(tmp_path, by_program):
    options = {"cells": 24, "steps": 6}
    whole = willmore.Run.start("flow", "builtin:cross", tmp_path / "whole", **options)
    assert whole.finished and whole.report["steps"] == 6
    run = interrupted(tmp_path / "run", 2, **options)
    assert not run.finished and run.report == {} and list(run.metrics["step"]) == [1, 2] and run.mesh is None
    assert "not finished" in repr(run)
    with pytest.raises(willmore.Error, match="resume"):
        run.field
    if by_program:
        program("resume", tmp_path / "run")
    else:
        assert run.resume() is run
    assert run.finished and run.report == whole.report
    assert files(tmp_path / "run") == files(tmp_path / "whole")
    before = files(tmp_path / "run")
    assert run.resume() is run and files(tmp_path / "run") == before


def test_a_run_goes_on_to_more_steps(tmp_path):
    run = willmore.Run.start("flow", "builtin:cross", tmp_path / "run", cells=24, steps=3)
    result = willmore.flow("builtin:cross", cells=24, steps=3).run()
    assert np.array_equal(run.field, result.field)
    assert run.resume(steps=5).report["steps"] == 5
    assert np.array_equal(run.field, willmore.flow("builtin:cross", cells=24, steps=5).run().field)


def test_runs_of_arrays(noisy, square, tmp_path):
    run = willmore.Run.start("fair", noisy, tmp_path / "mesh", cells=24, steps=1, volume="keep")
    assert np.array_equal(run.mesh.vertices, willmore.fair(noisy, cells=24, steps=1).mesh.vertices)
    hole = np.zeros_like(square)
    hole[24:34, 12:34] = True
    run = willmore.Run.start("inpaint", square, tmp_path / "image", mask=hole, cells=48, steps=2)
    assert np.array_equal(run.field, willmore.inpaint(square, hole, cells=48, steps=2).field)
    run = willmore.Run.start("mcf", "builtin:cross", tmp_path / "mcf", cells=24, steps=2)
    assert run.metrics["length"][1] < run.metrics["length"][0]


def test_refused_runs(tmp_path):
    with pytest.raises(willmore.Error, match="not the folder of a run"):
        willmore.Run.open(tmp_path)
    with pytest.raises(willmore.Error, match="no job"):
        willmore.Run.start("flown", "builtin:cross", tmp_path / "run")
    with pytest.raises(willmore.Error, match="`stepps`"):
        willmore.Run.start("flow", "builtin:cross", tmp_path / "run", stepps=3)
    with pytest.raises(willmore.Error, match="`mask`.*flow"):
        willmore.Run.start("flow", "builtin:cross", tmp_path / "run", mask="ball:0,0,0.2", cells=24, steps=1)
    assert not (tmp_path / "run").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("Dear")
    with pytest.raises(willmore.Error):
        willmore.Run.start("flow", "builtin:cross", tmp_path / "full", cells=24, steps=1)
    assert (tmp_path / "full" / "letter.txt").read_text() == "Dear"
