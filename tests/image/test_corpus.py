"""Hostile files of every format: none may crash, hang, hoard, print or be taken for a picture (goals G1 to G4)."""

from __future__ import annotations

import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from corpus.catalogue import CORPORA, bombs
from corpus.files import READ, READ_PHOTOGRAPH, Bad, Corpus, Good
from corpus.mutants import mutants
from corpus.runner import Outcome, Reader
from relume.image import files
from relume.image.files.textures.ktx2 import read_cube
from relume.image.photograph import Photograph

MUTANTS, MANY_MUTANTS = 250, 10_000
"""Of each format: whenever the tests run, and in the thorough run."""
NAMES = list(CORPORA)
TRIAL = Bad("a trial", b"abc", ".bin")


@pytest.fixture(scope="module")
def corpora() -> Callable[[str], Corpus]:
    """The corpus of a name, made once."""
    return cache(lambda name: CORPORA[name]())


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    """One child process for the whole module, as long as it lives."""
    yield from children(tmp_path_factory.mktemp("hostile"))


def children(folder: Path) -> Iterator[Reader]:
    if not sys.platform.startswith("linux"):
        pytest.skip("memory is bounded and measured as Linux does it")
    with Reader(folder) as reader:
        yield reader


def warmed(reader: Reader, corpus: Corpus) -> None:
    outcomes = reader.warm(corpus.good, corpus.doors)
    assert_none(fault for o in outcomes if o.kind in ("raised", "died", "hung") for fault in o.faults())


def assert_none(faults: Iterable[str]) -> None:
    found = list(faults)
    assert not found, "\n".join([f"{len(found)} faults", *found[:30]])


def complaints(outcomes: list[Outcome]) -> list[str]:
    """What G4 forbids, of single files and of all the refusals together."""
    found = [fault for outcome in outcomes for fault in outcome.faults()]
    refused = [outcome for outcome in outcomes if outcome.is_refused]
    vague = [outcome for outcome in refused if not outcome.says_where]
    if len(vague) > 0.01 * len(refused):
        shown = Counter(outcome.error.removeprefix(outcome.path) for outcome in vague).most_common(5)
        found.append(f"{len(vague)} of {len(refused)} refusals state no place: {shown}")
    return found


@pytest.mark.parametrize("name", NAMES)
def test_good_files_hold_what_they_were_made_of(corpora, tmp_path, name):
    for good in corpora(name).good:
        path = tmp_path / f"good{good.suffix}"
        path.write_bytes(good.data)
        with warnings.catch_warnings():
            if name == "gain map":  # that it is made for displays
                warnings.simplefilter("ignore", UserWarning)
            warnings.filterwarnings("ignore", message=".*left out: the part ")  # of an EXR of two
            assert_holds(good, path, name)


def assert_holds(good: Good, path: Path, name: str) -> None:
    if name == "camera raw":
        assert files.read_raw(path).mosaic.size > 0, good.name
        return
    if name == "KTX2":
        levels = read_cube(path)
        values = levels[0].reshape(-1, levels[0].shape[2], 3)
    else:
        image = files.read_radiance(path) if name == "gain map" else files.read(path)
        values = image.pixels if isinstance(image, Photograph) else image.radiance
    if good.pixels is None:
        return
    if good.pixels.ndim == 2:
        values = values @ np.array([0.2126, 0.7152, 0.0722])
    assert values.shape == good.pixels.shape, good.name
    worst = np.abs(values.astype(np.float64) - good.pixels).max() / np.abs(good.pixels).max()
    assert worst <= good.tolerance, f"{good.name}: off by {worst:.3g}"


@pytest.mark.parametrize("name", NAMES)
def test_there_are_sixty_distinct_bad_files(corpora, name):
    bad = corpora(name).bad
    assert len({file.data for file in bad} - {file.data for file in corpora(name).good}) == len(bad) >= 60
    assert len({file.name for file in bad}) == len(bad)


@pytest.mark.parametrize("name", NAMES)
def test_bad_files_are_refused_in_one_line(corpora, reader, name):
    corpus = corpora(name)
    warmed(reader, corpus)
    outcomes, taken = [], []
    for bad in corpus.bad:
        seen = [reader.read(bad, door) for door in corpus.doors]
        outcomes += seen
        if bad.refused and seen[0].kind == "read":
            taken.append(f"{bad.name}: taken for a picture")
    assert_none(complaints(outcomes) + taken)


@pytest.mark.parametrize("name", NAMES)
def test_mutants_do_no_harm(corpora, reader, name):
    assert_harmless(corpora(name), reader, MUTANTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_ten_thousand_mutants_do_no_harm(corpora, reader, name):
    assert_harmless(corpora(name), reader, MANY_MUTANTS)


def assert_harmless(corpus: Corpus, reader: Reader, count: int) -> None:
    warmed(reader, corpus)
    outcomes = [reader.read(bad, door) for bad, door in mutants(corpus, count)]
    assert len(outcomes) == count
    assert_none(complaints(outcomes))


def test_mutants_are_the_same_each_time_and_not_all_refused_by_their_first_bytes(corpora):
    for corpus in map(corpora, NAMES):
        twice = [[bad.data for bad, _ in mutants(corpus, 60)] for _ in range(2)]
        assert twice[0] == twice[1]
        good = {file.data[:4] for file in corpus.good}
        assert sum(data[:4] in good for data in twice[0]) > 30
        assert len(set(twice[0])) > 55


def test_bombs_are_refused_at_once_and_in_little_memory(corpora, reader):
    found = []
    for bad, door, name in bombs():
        warmed(reader, corpora(name))
        outcomes = [reader.read(bad, door)]
        if not outcomes[0].is_refused:
            found.append(f"{bad.name}: {outcomes[0].kind}, {outcomes[0].growth / 2**20:.0f} MiB")
            continue
        outcomes += [reader.read(bad, door) for _ in range(4)]
        found += complaints(outcomes)
        # The best of five, and of the processor: what other programs do meanwhile is not the reader's.
        seconds, growth = min(o.computed for o in outcomes), min(o.growth for o in outcomes)
        if seconds > 0.05 or growth > 8 * 2**20:
            found.append(f"{bad.name}: {1000 * seconds:.0f} ms, {growth / 2**20:.1f} MiB")
    assert_none(found)


@pytest.mark.parametrize(("folder", "least"), [("malformed", 120), ("formats", 80)])
def test_files_of_others_are_refused_or_read_cleanly(shared, corpora, reader, folder, least):
    for name in ("Radiance", "PFM", "float TIFF", "LogLuv TIFF", "EXR", "JPEG"):
        warmed(reader, corpora(name))
    paths = [path for path in sorted((shared / "data" / folder).rglob("*")) if path.is_file() and path.suffix != ".md"]
    assert len(paths) >= least
    outcomes = [reader.read_path(path, READ) for path in paths]
    assert_none(fault for outcome in outcomes for fault in outcome.faults())


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    """Another child, whose readers misbehave."""
    yield from children(tmp_path_factory.mktemp("trials"))


@pytest.mark.parametrize(
    ("trial", "fault"),
    [
        ("dying", "died: of SIGSEGV"),
        ("leaving", "died: with exit code 0"),
        ("hanging", "hung: no answer in 1 s"),
        ("raising", "raised: IndexError: list index out of range"),
        ("grasping", "raised: MemoryError"),
        ("speaking", "more than one line"),
        ("anonymous", "does not begin with the file"),
        ("printing", "printed 'libexample: bad file"),
        ("hoarding", "MiB of memory where 96 are allowed"),
        ("warning_of_numbers", "a bare warning: 'overflow"),
        ("warning_of_nothing", "warns, but not in a line about the file"),
    ],
)
def test_the_runner_notices(trials, trial, fault):
    deaths = trials.deaths
    outcome = trials.read(TRIAL, f"corpus.doors:{trial}", patience=1.0 if trial == "hanging" else 10.0)
    assert len(outcome.faults()) == 1 and fault in outcome.faults()[0]
    assert trials.deaths - deaths == (trial in ("dying", "leaving", "hanging"))
    # And the next file is read as if nothing had been.
    after = trials.read(TRIAL, "corpus.doors:exact")
    assert (after.faults(), after.is_refused, after.says_where) == ([], True, True)


def test_the_runner_measures_time_and_memory(trials):
    outcome = trials.read(TRIAL, "corpus.doors:dawdling")
    assert outcome.faults() == [] and outcome.computed >= 0.2
    assert "refused after 2.10 s" in replace(outcome, computed=2.1).faults()[0]
    assert trials.read(TRIAL, "corpus.doors:hoarding").growth >= 190 * 2**20
    # What one file took is not counted against the next.
    assert trials.read(TRIAL, "corpus.doors:exact").growth < 2**20


def test_refusals_that_say_no_place_are_counted(trials):
    vague, exact = (trials.read(TRIAL, f"corpus.doors:{door}") for door in ("vague", "exact"))
    assert (vague.faults(), vague.says_where) == ([], False)
    assert "1 of 100 refusals" not in str(complaints([vague, *[exact] * 99]))
    assert "1 of 99 refusals state no place" in complaints([vague, *[exact] * 98])[0]


def test_a_photograph_is_read_through_the_runner_too(corpora, reader):
    warmed(reader, corpora("PNG"))
    outcome = reader.read(corpora("PNG").good[0], READ_PHOTOGRAPH)
    assert (outcome.kind, outcome.decoded, outcome.faults()) == ("read", 4 * 3 * 16 * 8, [])
