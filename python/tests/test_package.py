"""The package as a whole."""

import doctest
import importlib
import inspect
import pkgutil
import re
import statistics
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import willmore

FOLDER = Path(__file__).parents[1]
MODULES = ["willmore", *(f"willmore.{module.name}" for module in pkgutil.iter_modules(willmore.__path__) if module.name != "_willmore")]


def test_version():
    manifest = FOLDER.parent / "Cargo.toml"
    if not manifest.exists():
        pytest.skip("not in the folder of the sources")
    version = re.search(r'^version = "(.*)"$', manifest.read_text(encoding="utf-8"), re.MULTILINE)
    assert version and version[1] == willmore.__version__


def test_import_is_quick():
    script = "import numpy, time; begun = time.perf_counter(); import willmore; print(time.perf_counter() - begun)"
    times = [float(subprocess.run([sys.executable, "-c", script], capture_output=True, check=True).stdout) for _ in range(5)]
    assert statistics.median(times) < 0.1, times


def test_import_takes_only_numpy():
    script = "import sys, willmore; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True, text=True).stdout.split()
    assert not {"trimesh", "pyvista", "meshio", "nibabel", "skimage", "scipy", "matplotlib", "tqdm"} & set(modules)


def public_functions():
    for module in (willmore, willmore.exact):
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.isfunction(thing):
                yield f"{module.__name__}.{name}", thing
    for kind in (willmore.Run, willmore.Network):
        for name, thing in inspect.getmembers(kind, callable):
            if not name.startswith("_"):
                yield f"{kind.__name__}.{name}", thing


FUNCTIONS = list(public_functions())


@pytest.mark.parametrize("name, function", FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_functions_say_what_they_take_and_give(name, function):
    text = inspect.getdoc(function)
    assert text and text.splitlines()[0].endswith(".")
    signature = inspect.signature(function)
    assert "Parameters\n----------" in text
    for parameter in signature.parameters:
        if parameter != "self":
            assert re.search(rf"^[*\w, ]*\b{parameter}\b", text, re.MULTILINE), parameter
    if signature.return_annotation != "None":
        assert "Returns\n-------" in text
    if name != "willmore.exact.circle_radius":
        assert "Raises\n------\nError" in text


def test_all_names_have_a_text():
    for module in (willmore, willmore.exact):
        for name in module.__all__:
            assert getattr(module, name).__doc__, name
        assert sorted(module.__all__) == module.__all__
    for name in willmore.__all__:
        if name not in ("Arrays", "Error", "Flow", "Result", "State", "WillmoreWarning"):
            assert f"`{name}`" in willmore.__doc__, name


@pytest.mark.parametrize("name", MODULES)
def test_examples(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner()
    for test in doctest.DocTestFinder().find(module):
        runner.run(test)
    assert runner.failures == 0


def test_there_are_examples():
    finder = doctest.DocTestFinder(exclude_empty=True)
    tested = {test.name for name in MODULES for test in finder.find(importlib.import_module(name)) if test.examples}
    assert {"willmore._jobs.fair", "willmore._jobs.flow", "willmore._jobs.surfaces", "willmore.exact.vesicle"} <= tested


def test_errors_are_value_errors():
    assert issubclass(willmore.Error, ValueError) and issubclass(willmore.WillmoreWarning, UserWarning)


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (2, 3), (0, 3), (3, 0), (2, 2)], ids=str)
def test_no_panic_reaches_python(shape):
    """Arrays of shapes that nobody should give raise errors, and never what is no `Exception`."""
    plane, space, faces = np.zeros(shape), np.zeros((*shape, 2)), np.zeros(shape, dtype=np.uint32)
    for act in (
        lambda: willmore.fair((plane, faces)),
        lambda: willmore.repair((plane, faces)),
        lambda: willmore.signed_distance((plane, faces), plane),
        lambda: willmore.flow(plane),
        lambda: willmore.flow(space),
        lambda: willmore.flow(plane > 0),
        lambda: willmore.flow(plane.astype(np.uint8)),
        lambda: willmore.energy(space),
        lambda: willmore.inpaint(plane, plane > 0),
        lambda: willmore.inpaint(plane > 0, plane == 0),
        lambda: willmore.inpaint(space, space > 0),
        lambda: willmore.surfaces(space),
        lambda: willmore.surfaces(space + 1, affine=plane),
        lambda: willmore.surfaces(space, threshold=0.5),
        lambda: willmore.zero_level(plane),
        lambda: willmore.zero_level(space),
        lambda: willmore.exact.Shape.polygon(plane),
        lambda: willmore.exact.Shape.smooth(plane),
    ):
        with pytest.raises(willmore.Error):
            act()
