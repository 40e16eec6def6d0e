"""Strike off the lists in not_yet/ what is mended by now: `PYTHONPATH=tests python -m architecture.strike_off`."""

from __future__ import annotations

from functools import cache

from architecture.lengths import functions_too_long, functions_without_steps
from architecture.reached import unreached
from architecture.tree import LISTS, PACKAGE, REPOSITORY
from architecture.words import lines_too_long, private_words


@cache
def faults() -> dict[str, set[str]]:
    """The places that each rule finds today, as its list names them."""
    return {
        "words": {fault.split(":")[0] for fault in private_words(REPOSITORY)},
        "long_lines": {fault.split(":")[0] for fault in lines_too_long(REPOSITORY)},
        "unreached": set(unreached(PACKAGE)),
        "long_functions": {fault.split(": ")[0] for fault in functions_too_long(PACKAGE)},
        "bare_functions": {fault.split(": ")[0] for fault in functions_without_steps(PACKAGE)},
    }


if __name__ == "__main__":
    for name, found in faults().items():
        file = LISTS / f"{name}.txt"
        lines = file.read_text(encoding="utf-8").splitlines()
        kept = [line for line in lines if line.startswith("#") or line in found]
        file.write_text("\n".join(kept) + "\n", encoding="utf-8")
        print(f"{name}: {len(lines) - len(kept)} struck off, {len(kept) - 1} left")
