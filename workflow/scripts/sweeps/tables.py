"""The tables of runs and of folders: read, checked, and expanded into runs."""

import csv
import difflib
import hashlib
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator

SCHEMAS = Path(__file__).parents[2] / "schemas"
# The group of the runs of the first table; those of a folder are in a group of its name.
SWEEP = "sweep"
# Columns that are no options of the program.
OWN_COLUMNS = {"run", "command", "input", "folder", "path", "files"}
# Options whose value may be a file.
FILE_OPTIONS = ("mask", "keep", "network")
NO_FILE = re.compile(r"(builtin|box|ball|colour):")
# What the program reads in space.
SUFFIXES = (".obj", ".stl", ".ply", ".off", ".nii", ".nii.gz", ".nrrd", ".nhdr", ".mgh", ".mgz", ".mrc", ".map", ".tif", ".tiff", ".npy")
GPUS = {"wgpu", "cuda"}

Cells = dict[str, Any]


class TableError(Exception):
    """Everything that is wrong with the tables, one line each."""

    def __init__(self, lines: list[str]):
        super().__init__("\n".join(lines))
        self.lines = lines


@dataclass(frozen=True)
class Run:
    """One call of the program."""

    group: str
    name: str
    command: str
    input: str
    options: Cells = field(hash=False)

    def files(self) -> list[str]:
        """The files that the run reads."""
        values = [self.input, *(str(self.options[name]) for name in FILE_OPTIONS if name in self.options)]
        return [value for value in values if not NO_FILE.match(value)]

    def gpus(self) -> int:
        """How many GPUs the run takes."""
        return int(self.options.get("device") in GPUS)


@dataclass(frozen=True)
class Row:
    """A row of a table and its place in the file."""

    place: str
    cells: Cells


def load(runs: str | None, folders: str | None) -> dict[str, list[Run]]:
    """The runs of both tables by their groups. Raises TableError with all errors at once."""
    errors: list[str] = []
    groups: dict[str, list[Run]] = {}
    for table, kind in ((runs, "runs"), (folders, "folders")):
        if not table:
            continue
        rows = _checked_rows(table, kind, errors)
        if kind == "runs":
            groups[SWEEP] = _unique(list(_sweep(rows, errors)), table, errors)
        else:
            for row in rows:
                _add_folder(row, groups, errors)
    if not runs and not folders:
        errors.append("config.yaml names no table: add a line such as `runs: config/runs.tsv`")
    if errors:
        raise TableError(errors)
    return groups


def schema(kind: str) -> Cells:
    """The schema of the rows of a table: its own columns and the options of the program."""
    own, options = (yaml.safe_load((SCHEMAS / f"{name}.schema.yaml").read_text(encoding="utf-8")) for name in (kind, "options"))
    return {**options, "properties": {**own["properties"], **options["properties"]}, "required": own["required"]}


def check_config(config: Cells, path: str) -> list[str]:
    """What is wrong with the configuration."""
    expected = yaml.safe_load((SCHEMAS / "config.schema.yaml").read_text(encoding="utf-8"))
    lines = []
    for key in sorted(map(str, set(config) - set(expected["properties"]))):
        lines.append(f"{path}, {key}: there is no such entry{_similar(key, expected['properties'])}")
    for error in Draft202012Validator(expected).iter_errors(config):
        if error.path:
            entry = ".".join(str(part) for part in error.path)
            wants = expected["properties"][str(error.path[0])]["wants"]
            lines.append(f"{path}, {entry}: {error.message}; give {wants}")
    return lines


def _checked_rows(table: str, kind: str, errors: list[str]) -> list[Row]:
    """The rows of a table that have no errors."""
    path, rules = Path(table), schema(kind)
    if not path.is_file():
        errors.append(f"{table}: there is no such table; write one, or correct its name in config.yaml")
        return []
    try:
        rows = list(_read_yaml(path) if path.suffix in (".yaml", ".yml") else _read_tsv(path))
        rows = [Row(row.place, {name: _typed(cell, str(name), rules) for name, cell in row.cells.items()}) for row in rows]
    except TableError as error:
        errors.extend(error.lines)
        return []
    if not rows:
        errors.append(f"{table}: the table has no rows; add one below the header")
    good = []
    for row in rows:
        before = len(errors)
        errors.extend(_row_errors(row, rules))
        if len(errors) == before:
            good.append(row)
    return good


def _read_tsv(path: Path) -> Iterator[Row]:
    """Rows of a table with tabs. Empty cells are left out. The header is row 1, as in a spreadsheet."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file, delimiter="\t")
        header: list[str] | None = None
        for cells in reader:
            place = f"{path}, row {reader.line_num}"
            cells = [cell.strip() for cell in cells]
            if not any(cells) or cells[0].startswith("#"):
                continue
            if header is None:
                header = _header(cells, place)
                continue
            if len(cells) > len(header):
                raise TableError([f"{place}: {len(cells)} cells, but the header has {len(header)} columns; remove a tab, or name the column"])
            yield Row(place, {name: cell for name, cell in zip(header, cells) if cell})


def _header(cells: list[str], place: str) -> list[str]:
    if len(cells) == 1:
        raise TableError([f"{place}: the header has no tab; separate columns by tabs"])
    for name in cells:
        if not name:
            raise TableError([f"{place}: column {cells.index(name) + 1} has no name; name it, or remove it"])
        if cells.count(name) > 1:
            raise TableError([f"{place}, column {name}: two columns have this name; remove one"])
    return cells


def _typed(cell: Any, column: str, rules: Cells) -> Any:
    """The value of a text as the schema wants it; the text itself if it cannot be read as such. The program takes 64 where a table has 64.0."""
    types = rules["properties"].get(column, {}).get("type", [])
    if isinstance(cell, float) and cell.is_integer() and "integer" in types:
        return int(cell)
    if not isinstance(cell, str):
        return cell
    if "boolean" in types:
        return {"true": True, "false": False}.get(cell.lower(), cell)
    read = int if "integer" in types else float if types == "number" else str
    try:
        return read(cell)
    except ValueError:
        return cell


def _read_yaml(path: Path) -> Iterator[Row]:
    """Entries of a list. A list as a value stands for one run for each of its items, in all combinations."""
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise TableError([f"{path}: no YAML: {' '.join(str(error).split())}"]) from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise TableError([f"{path}: not a list of runs; begin each with `- run: NAME`"])
    for number, entry in enumerate(entries, 1):
        place = f"{path}, row {number}"
        entry = {key: value for key, value in entry.items() if value is not None}
        lists = {key: value for key, value in entry.items() if isinstance(value, list)}
        for values in itertools.product(*lists.values()):
            chosen = dict(zip(lists, values))
            cells = {**entry, **chosen}
            if chosen and isinstance(cells.get("run"), str):
                cells["run"] += "".join(f"_{_slug(str(value))}" for value in chosen.values())
            yield Row(place, cells)


def _slug(text: str) -> str:
    """A text as a part of a file name: `builtin:cross` is cross, `scans/a b.ply` is a_b.ply and 1.5% is 1.5pct."""
    text = text.removeprefix("builtin:").rsplit("/", 1)[-1].replace("%", "pct")
    return re.sub(r"[^A-Za-z0-9.=+-]", "_", text)


def _row_errors(row: Row, rules: Cells) -> Iterator[str]:
    properties = rules["properties"]
    name = row.cells.get("run", row.cells.get("folder"))
    place = f"{row.place} ({name})" if name else row.place
    for column in rules["required"]:
        if column not in row.cells:
            yield f"{place}, column {column}: the cell is empty; give {properties[column]['wants']}"
    command = row.cells.get("command", "fair")
    for column, value in row.cells.items():
        if column not in properties:
            yield f"{place}, column {column}: there is no such option{_similar(str(column), properties)}"
            continue
        rule = properties[column]
        if not Draft202012Validator({**rule, "$defs": rules["$defs"]}).is_valid(value):
            required = column in rules["required"]
            yield f'{place}, column {column}: "{value}" is not {rule["wants"]}; correct it{"" if required else ", or leave the cell empty"}'
        elif command not in rule.get("commands", [command]):
            others = " or ".join(rule["commands"])
            yield f"{place}, column {column}: the command {command} has no such option; leave the cell empty, or take the command {others}"


def _similar(name: str, names: Any) -> str:
    found = difflib.get_close_matches(name, list(names), 1)
    return f"; a similar one is {found[0]}" if found else "; remove it"


def _sweep(rows: list[Row], errors: list[str]) -> Iterator[Run]:
    for row in rows:
        run = Run(SWEEP, row.cells["run"], row.cells["command"], row.cells["input"], _options(row))
        errors.extend(_missing_files(run, row))
        yield run


def _options(row: Row) -> Cells:
    return {name: value for name, value in row.cells.items() if name not in OWN_COLUMNS}


def _missing_files(run: Run, row: Row) -> Iterator[str]:
    for column, value in [("input", run.input), *((name, str(run.options[name])) for name in FILE_OPTIONS if name in run.options)]:
        if value in run.files() and not Path(value).exists():
            yield f"{row.place} ({run.name}), column {column}: there is no file {value}; correct its path, which begins at the folder of the sweep"


def _unique(runs: list[Run], table: str, errors: list[str]) -> list[Run]:
    names = [run.name for run in runs]
    for name in sorted({name for name in names if names.count(name) > 1}):
        errors.append(f"{table}, column run: two runs have the name {name}; give one of them another name")
    return runs


def _add_folder(row: Row, groups: dict[str, list[Run]], errors: list[str]) -> None:
    """Adds a run for every file of a folder."""
    name, path, pattern = row.cells["folder"], Path(row.cells["path"]), row.cells.get("files", "*")
    place = f"{row.place} ({name})"
    if name in groups:
        errors.append(f"{place}, column folder: two rows have this name; give one of them another name")
    elif not path.is_dir():
        errors.append(f"{place}, column path: there is no folder {path}; correct the path, which begins at the folder of the sweep")
    else:
        files = sorted(file for file in path.glob(pattern) if file.is_file() and file.name.lower().endswith(SUFFIXES))
        if not files:
            errors.append(f"{place}, column path: {path} has no meshes or volumes that match {pattern}; correct the path or the column files")
        command, options = row.cells.get("command", "fair"), _options(row)
        names = _file_names(files)
        groups[name] = [Run(name, names[file], command, str(file), options) for file in files]
        for run in groups[name][:1]:
            errors.extend(_missing_files(run, row))


def _file_names(files: list[Path]) -> dict[Path, str]:
    """Names for the runs of files: those of the files. Names that would become equal get a part of a checksum."""
    slugs = {file: _slug(file.name) for file in files}
    taken = list(slugs.values())
    return {file: slug if taken.count(slug) == 1 else f"{slug}-{hashlib.sha256(file.name.encode()).hexdigest()[:6]}" for file, slug in slugs.items()}
