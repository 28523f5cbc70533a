"""What the benchmarks share: sides that take turns, a table, a JSON file."""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from statistics import median
from typing import TypedDict

Run = Callable[[], list[float]]
"""One round of a side: how long each of its samples took."""

HEAD = ("case", "side", "p50", "p99", "rounds' medians", "samples")


class Figures(TypedDict):
    """The figures of one side. `spread`: the 10th and the 90th percentile of its rounds'
    medians.
    """

    p50: float
    p99: float
    spread: tuple[float, float]
    samples: int


@dataclass
class Case:
    """One comparison. `rounds` are those of each side, each a list of times in `unit`; `aim` is the
    target in words.

    The first side is ours. The ratio is that of its times to those of the second: below 1 is
    faster.
    """

    name: str
    unit: str
    aim: str = ""
    rounds: dict[str, list[list[float]]] = field(default_factory=dict)

    def take_turns(self, times: int, **sides: Run) -> "Case":
        """Run all sides in turn, `times` times, every second time in the opposite order."""
        self.rounds = {side: [] for side in sides}
        for turn in range(times):
            for side in sides if turn % 2 == 0 else reversed(sides):
                self.rounds[side].append(sides[side]())
        return self

    def sides(self) -> dict[str, Figures]:
        """The figures of each side."""
        return {side.replace("_", " "): _figures(rounds) for side, rounds in self.rounds.items()}

    def ratio(self) -> tuple[float, tuple[float, float]] | None:
        """Ours over the second side: the ratio of the medians, and the spread of the rounds' own
        ratios.
        """
        if len(self.rounds) < 2:
            return None
        ours, other = list(self.rounds.values())[:2]
        each = [median(a) / median(b) for a, b in zip(ours, other, strict=True)]
        return median(chain(*ours)) / median(chain(*other)), _spread(each)

    def rows(self) -> Iterator[tuple[str, ...]]:
        """The lines of the table."""
        for side, its in self.sides().items():
            p50, p99 = (f"{value:.4g} {self.unit}" for value in (its["p50"], its["p99"]))
            yield self.name, side, p50, p99, _between(its["spread"], ".4g"), str(its["samples"])
        if ratio := self.ratio():
            yield self.name, "ratio", f"{ratio[0]:.2f}", "", _between(ratio[1], ".2f"), ""

    def as_json(self) -> dict[str, object]:
        """This case for the JSON file."""
        row: dict[str, object] = {
            "case": self.name,
            "unit": self.unit,
            "aim": self.aim,
            "sides": self.sides(),
        }
        if ratio := self.ratio():
            row["ratio"] = {"of_medians": ratio[0], "spread": ratio[1]}
        return row


def parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """The flags that every benchmark has."""
    made = argparse.ArgumentParser(prog=f"benchmarks/{name}.py", description=description)
    file = Path(__file__).with_name(f"{name}.json")
    made.add_argument(
        "--json",
        type=Path,
        default=file,
        metavar="FILE",
        help="where the figures go (default: beside)",
    )
    made.add_argument(
        "--quick", action="store_true", help="a few seconds: shows that it runs, not how fast it is"
    )
    return made


def publish(name: str, cases: list[Case], file: Path, **more: object) -> None:
    """Print the table, and write the JSON."""
    show([HEAD, *(row for case in cases for row in case.rows())])
    for aim in dict.fromkeys(case.aim for case in cases if case.aim):
        print(f"aim: {aim}")
    write(name, file, cases=[case.as_json() for case in cases], **more)


def show(rows: list[tuple[str, ...]]) -> None:
    """Print a table."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )


def write(name: str, file: Path, **figures: object) -> None:
    """Write figures as JSON, with the machine and its load."""
    machine = {
        "cpus": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
    }
    head = {"benchmark": name, "machine": machine, "load": os.getloadavg()}
    file.write_text(json.dumps(head | figures, indent=1) + "\n")
    print(f"figures: {file}")


def _figures(rounds: list[list[float]]) -> Figures:
    samples = sorted(chain(*rounds))
    return {
        "p50": median(samples),
        "p99": samples[min(len(samples) - 1, int(len(samples) * 0.99))],
        "spread": _spread([median(one) for one in rounds]),
        "samples": len(samples),
    }


def _spread(values: list[float]) -> tuple[float, float]:
    ordered, last = sorted(values), len(values) - 1
    return ordered[round(last * 0.1)], ordered[round(last * 0.9)]


def _between(spread: tuple[float, float], form: str) -> str:
    return " .. ".join(format(value, form) for value in spread)
