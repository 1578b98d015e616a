"""How often 2 u_num covers the true error: 200 random bodies against another code.

    python benchmarks/bodies.py truth            # NGSolve; about 20 minutes on one core; writes
                                                 # benchmarks/bodies_truth.json
    python benchmarks/bodies.py truth 7 18       # these seeds anew
    python benchmarks/bodies.py table            # our side, a row a class; about 8 minutes

Needs `pip install -e ".[oracle]"` for `truth` alone.
"""

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from bodies_drawn import SEEDS, drawn

FILE = Path(__file__).with_name("bodies_truth.json")
#: (order, layers towards an edge): a coarse answer and the one that is kept.
SECTION, BRICKS = ((5, 3), (7, 4)), ((3, 2), (4, 2))


def truth(seeds: Iterable[int]) -> None:
    """Computes the answers and keeps them in the file."""
    import ngsolve
    from bodies_oracle import answer

    ngsolve.SetNumThreads(1)
    kept = json.loads(FILE.read_text()) if FILE.exists() else {"answers": {}}
    kept["code"] = "NGSolve"
    kept["version"] = ngsolve.__version__
    for seed in seeds:
        body = drawn(seed)
        rough, fine = SECTION if body.kind == "cylinder" else BRICKS
        first = answer(body, *rough)
        order, layers, found = fine[0], fine[1], None
        while found is None:  # Newton may fail in the thinnest cells of a corner
            try:
                found = answer(
                    body, order, layers, None if body.law == "linear" else first.solution
                )
            except RuntimeError:
                layers -= 1
        moved = np.subtract(found.values, first.values)
        change = float(np.linalg.norm(moved) / np.linalg.norm(found.values))
        kept["answers"][str(seed)] = {
            "values": [float(f"{v:.8g}") for v in found.values], "unit": "N" if body.moves else "m",
            "change": float(f"{change:.2g}"), "order": order, "layers": layers,
            "cells": found.cells, "unknowns": found.unknowns,
        }  # fmt: skip
        _write(kept)
        print(f"{seed:4d} {body.title:22s} {body.law:9s} nu {body.nu:<6g} {change:.1e}", flush=True)


def truths() -> dict[int, list[float]]:
    """The kept answers by seed: N, or m of every marker along x, y, z."""
    return {int(s): row["values"] for s, row in json.loads(FILE.read_text())["answers"].items()}


def table(seeds: Iterable[int]) -> None:
    """Prints a row for every class of bodies, and those that are not covered."""
    from bodies_ours import judged

    kept, classes = truths(), defaultdict(list)
    missed = []
    for seed in seeds:
        body = drawn(seed)
        one = judged(body, kept[seed])
        classes[body.title].append(one)
        if not one.covered:
            missed.append(
                f"seed {seed}: {body.title}, {body.law}, nu {body.nu:g}: error "
                f"{one.error / one.answer:.2%}, 2 u_num {2 * one.found.u / one.answer:.2%}; "
                f"{one.found.words}"
            )
    print("| bodies | count | within 2 u_num | median 2 u_num / error | median error |")
    print("| --- | --- | --- | --- | --- |")
    for title in sorted(classes):
        print(_row(title, classes[title]))
    print(_row("all", [one for found in classes.values() for one in found]))
    print("\n".join(missed))


def _row(title: str, found: list[Any]) -> str:
    covered = sum(one.covered for one in found)
    ratio = np.median([one.ratio for one in found])
    error = np.median([one.error / one.answer for one in found])
    return (
        f"| {title} | {len(found)} | {covered} ({100 * covered / len(found):.0f} %) "
        f"| {ratio:.2f} | {100 * error:.2g} % |"
    )


def _write(kept: dict[str, Any]) -> None:
    answers = sorted(kept.pop("answers").items(), key=lambda item: int(item[0]))
    head = json.dumps(kept)[:-1]
    rows = ",\n".join(f'  "{seed}": {json.dumps(row)}' for seed, row in answers)
    FILE.write_text(f'{head}, "answers": {{\n{rows}\n}}}}\n')
    kept["answers"] = dict(answers)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("truth", "table"))
    parser.add_argument("seeds", nargs="*", type=int, help="all 200 if none is given")
    given = parser.parse_args()
    seeds = given.seeds or SEEDS
    if given.what == "truth":
        truth(seeds)
        return
    table(seeds)


if __name__ == "__main__":
    sys.exit(main())
