"""What the hostile files do, as a table: `PYTHONPATH=tests python -m corpus [--mutants 500] [format … | folder …]`.

A folder is read file by file; formats are those of the catalogue, all of them where none is named.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from corpus.catalogue import CORPORA
from corpus.files import READ
from corpus.mutants import mutants
from corpus.runner import Outcome, Reader


def main() -> None:
    """Print the table, and below it every fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=500)
    parser.add_argument("--faults", type=int, default=40, help="shown at most")
    parser.add_argument("what", nargs="*", default=list(CORPORA))
    given = parser.parse_args()
    found: list[str] = []
    with tempfile.TemporaryDirectory() as folder, Reader(Path(folder)) as reader:
        print(
            f"{'':34s}{'files':>7s}{'read':>7s}{'refused':>9s}{'where':>8s}{'raised':>8s}{'died':>6s}{'hung':>6s}{'ms':>7s}{'MiB':>6s}"
        )
        for name in given.what:
            if name not in CORPORA:
                paths = sorted(
                    path for path in Path(name).rglob("*") if path.is_file() and path.suffix not in (".md", ".txt")
                )
                outcomes = [reader.read_path(path, READ, name=f"{path.parent.name}/{path.name}") for path in paths]
                for outcome in outcomes:
                    said = outcome.error.removeprefix(outcome.path) or "; ".join(text for _, text in outcome.warnings)
                    cost = f"{1000 * outcome.seconds:6.0f} ms {outcome.growth / 2**20:5.0f} MiB"
                    print(f"  {outcome.kind:8s} {outcome.file[:60]:60s} {cost}  {said}")
                found += _row(name, outcomes)
                continue
            corpus = CORPORA[name]()
            # The first reading loads libraries; what that takes is no fault.
            reader.warm(corpus.good, corpus.doors)
            found += _row(f"{name}, good", reader.warm(corpus.good, corpus.doors))
            seen = [(bad, [reader.read(bad, door) for door in corpus.doors]) for bad in corpus.bad]
            found += _row(f"{name}, bad", [outcome for _, outcomes in seen for outcome in outcomes])
            found += [
                f"{name}: {bad.name}: taken for a picture"
                for bad, outcomes in seen
                if bad.refused and outcomes[0].kind == "read"
            ]
            found += _row(f"{name}, mutants", [reader.read(bad, door) for bad, door in mutants(corpus, given.mutants)])
    print(f"\n{len(found)} faults")
    for fault in found[: given.faults]:
        print(fault)


def _row(name: str, outcomes: Iterable[Outcome]) -> list[str]:
    outcomes = list(outcomes)
    kinds = Counter(outcome.kind for outcome in outcomes)
    refused = [outcome for outcome in outcomes if outcome.is_refused]
    where = sum(outcome.says_where for outcome in refused) / max(1, len(refused))
    slowest = max((outcome.computed for outcome in outcomes), default=0.0)
    growth = max((outcome.growth for outcome in outcomes), default=0)
    print(
        f"{name[-34:]:34s}{len(outcomes):7d}{kinds['read']:7d}{len(refused):9d}{100 * where:7.1f}%{kinds['raised']:8d}"
        f"{kinds['died']:6d}{kinds['hung']:6d}{1000 * slowest:7.0f}{growth / 2**20:6.0f}"
    )
    vague = Counter(o.error.removeprefix(o.path)[:150] for o in refused if not o.says_where)
    said = [f"{name}: {count} × no place: {line}" for line, count in vague.most_common(5)]
    return [f"{name}: {fault}" for outcome in outcomes for fault in outcome.faults()] + said


if __name__ == "__main__":
    main()
