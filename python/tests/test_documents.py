"""Code in the documents runs as it stands, and every script of the gallery writes its picture."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PYTHON = Path(__file__).resolve().parents[1]
REPOSITORY = PYTHON.parent
# The code of docs/sweeps.md reads results of a sweep; the tests of the sweeps run it.
DOCUMENTS = [
    path
    for path in (PYTHON / "README.md", REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md")))
    if path.exists() and path.name != "sweeps.md"
]
SCRIPTS = sorted(path for path in (PYTHON / "gallery").glob("*.py") if not path.name.startswith("_"))
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ENVIRONMENT = {**os.environ, "MPLBACKEND": "Agg"}


def program(document):
    """The blocks of a document in order, each at its own lines, so that an error names the line of the document."""
    text = document.read_text(encoding="utf-8")
    lines = [""] * (text.count("\n") + 1)
    for block in BLOCK.finditer(text):
        first = text.count("\n", 0, block.start(1))
        code = block.group(1).splitlines()
        lines[first : first + len(code)] = code
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("document", [path for path in DOCUMENTS if program(path).strip()], ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_blocks_of_a_document_run_in_order(document, tmp_path):
    script = tmp_path / "blocks.py"
    script.write_text(program(document), encoding="utf-8")
    folder = tmp_path / "folder"
    folder.mkdir()
    ran(subprocess.run([sys.executable, "-W", "error::DeprecationWarning:__main__", script], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True))


def test_the_first_picture_is_that_of_the_gallery():
    """The README shows the picture that its first blocks make."""
    assert 'figure.savefig("first.png")' in program(PYTHON / "README.md")
    assert (PYTHON / "gallery" / "pictures" / "first.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_of_the_gallery_writes_its_picture(script, tmp_path):
    ran(subprocess.run([sys.executable, script, tmp_path], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True))
    assert [path.name for path in tmp_path.iterdir()] == [f"{script.stem}.png"]
    assert (tmp_path / f"{script.stem}.png").read_bytes().startswith(b"\x89PNG")


def test_the_gallery_shows_every_picture():
    page = (PYTHON / "gallery" / "README.md").read_text(encoding="utf-8")
    for script in SCRIPTS:
        assert f"({script.name})" in page and f"(pictures/{script.stem}.png)" in page
        assert (script.parent / "pictures" / f"{script.stem}.png").exists()


def test_pictures_are_small():
    for picture in (PYTHON / "gallery" / "pictures").iterdir():
        assert picture.stat().st_size < 150_000, picture.name


def ran(done):
    assert done.returncode == 0, done.stdout + done.stderr
