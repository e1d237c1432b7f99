"""Makes a folder of 30 scans, of which one is truncated, one has an edge of three faces and one is empty: python3 scans.py FOLDER"""

import subprocess
import sys
from pathlib import Path

GOOD = 27


def make(folder: Path, program: str = "willmore") -> None:
    folder.mkdir(parents=True)

    def sample(*arguments: str) -> None:
        subprocess.run([program, "sample", *arguments, "--cells", "24", "--quiet"], check=True)

    for number in range(GOOD - 2):
        name = f"scan {number:02}.{('ply', 'obj', 'stl')[number % 3]}"
        sample("builtin:sphere", "--noise", "0.004", "--seed", str(number + 1), "--save", str(folder / name))
    sample("box:-0.3,-0.25,-0.2,0.3,0.25,0.2", "--save", str(folder / "body.nii.gz"))
    sample("builtin:sphere", "--save", str(folder / "body.nii"))
    whole = (folder / "scan 00.ply").read_bytes()
    (folder / "broken.ply").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.stl").touch()
    text = (folder / "scan 01.obj").read_text(encoding="utf-8")
    first, second, _ = next(line for line in text.splitlines() if line.startswith("f ")).split()[1:]
    (folder / "fin.obj").write_text(f"{text}v 1 1 1\nf {first} {second} -1\n", encoding="utf-8")
    (folder / "notes.txt").write_text("No scan, and so in no table.\n", encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]))
