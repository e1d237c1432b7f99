"""Makes a folder of 30 scans: one is truncated, one is empty, and one has three faces at an edge, none of which can move: python3 scans.py FOLDER"""

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
    corners = ("0 0 0", "0 0 1", "1 0 0", "-1 1 0", "-1 -1 0")
    lines = [f"v {corner}" for corner in corners] + [f"f 1 2 {third}" for third in (3, 4, 5)]
    (folder / "fan.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "notes.txt").write_text("No scan, and so in no table.\n", encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]))
