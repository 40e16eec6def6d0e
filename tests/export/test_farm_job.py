"""Jobs for render farms: the folder that is written, and the same bits from it as from one command."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from openjd.model import IntRangeExpr, decode_job_template

import relume as rl
from relume.errors import OutputNotWritten, UnreadableFile
from relume.project.forecast import memory_for
from relume.project.insertion.outcome import Inserted
from small_shot import write_small_shot

KEYS = "keyframes = [{ frame = 1, translate = [0, 0, 0] }, { frame = 6, translate = [0.1, 0, 0] }]\n"
BIN = Path(sys.executable).parent


def write_sequence(folder: Path, frames: str = "1-6") -> Path:
    """The small shot with a ball that moves over some frames."""
    path = write_small_shot(folder)
    text = path.read_text(encoding="utf-8").replace("[match]", f"{KEYS}[match]").replace("samples = 8", "samples = 4")
    path.write_text(f'{text}\n[sequence]\nframes = "{frames}"\n', encoding="utf-8")
    return path


def run(words: Sequence[str | Path], **more: str) -> subprocess.CompletedProcess[str]:
    """A command as a farm gives it, in a process of its own."""
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", **more}
    return subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=600, env=environment)


def bits(out: Path) -> dict[str, str]:
    """A hash of every picture and movie of a sequence, by its place in the folder."""
    pictures = [path for pattern in ("frame_*/*.exr", "frame_*/*.png", "*.mp4") for path in out.glob(pattern)]
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in pictures}


# The folder


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_sequence(tmp_path_factory.mktemp("a shot") / "it's here", "1-9,12-20x2")


def test_the_folder_holds_the_job_in_every_form(shot, tmp_path):
    settings = rl.report.JobSettings(samples=32, seed=7, noise=0.01, threads=2)
    made = rl.report.write_job(shot, tmp_path / "job", frames="1-9x2,12", chunk=4, settings=settings)
    assert (made.frames, made.tasks) == (6, 2) and made.memory == memory_for(192 * 128)
    assert sorted(path.name for path in made.folder.iterdir()) == [
        *("README.md", "assemble.txt", "asset_references.json", "commands.txt", "openjd_parameters.json"),
        *("parameter_values.json", "prepare.txt", "template.json"),
    ]
    out = str(tmp_path / "job" / "out")
    same = ["relume", "insert", str(shot), "-o", out]
    same += ["--samples", "32", "--seed", "7", "--noise", "0.01", "--threads", "2"]
    lines = {name: (made.folder / name).read_text().splitlines() for name in ("prepare.txt", "commands.txt")}
    assert [shlex.split(line) for line in lines["prepare.txt"]] == [[*same, "--prepare"]]
    assert [shlex.split(line) for line in lines["commands.txt"]] == [
        [*same, "--frames", "1-7:2", "--accept"],
        [*same, "--frames", "9,12", "--accept"],
    ]
    assert shlex.split((made.folder / "assemble.txt").read_text()) == [*same, "--frames", "1-9:2,12", "--assemble"]
    values = json.loads((made.folder / "parameter_values.json").read_text())["parameterValues"]
    assert {each["name"]: each["value"] for each in values} == {"Shot": str(shot), "Out": out, "Frames": "1-9:2,12"}
    assets = json.loads((made.folder / "asset_references.json").read_text())["assetReferences"]
    assert [Path(name).name for name in assets["inputs"]["filenames"]] == [
        "light.exr", "ball.glb", "plate.exr", "shot.toml",
    ]  # fmt: skip
    assert assets["outputs"] == {"directories": [out]}
    page = (made.folder / "README.md").read_text()
    assert "6 frames (1-9:2,12) in 2 tasks of up to 4" in page and "--array=1-2" in page
    # Deadline gives a task's ends alone, between which frames are missing here.
    assert "-frames 1-9x2,12 -chunksize 1" in page and "--threads 2 --frames <STARTFRAME>-<ENDFRAME> --accept" in page


def test_the_template_asks_for_memory_and_cores_and_is_one_of_openjd(shot, tmp_path):
    settings = rl.report.JobSettings(threads=3, accept=True)
    made = rl.report.write_job(shot, tmp_path / "job", frames="2-5", settings=settings)
    template = json.loads((made.folder / "template.json").read_text())
    read = decode_job_template(template=template, supported_extensions=["TASK_CHUNKING"])
    assert [step.name for step in read.steps] == ["Prepare", "Frames", "Assemble"]
    assert [[each.dependsOn for each in step.dependencies or []] for step in read.steps] == [
        [], ["Prepare"], ["Frames"],
    ]  # fmt: skip
    for step in template["steps"]:
        amounts = {each["name"]: each["min"] for each in step["hostRequirements"]["amounts"]}
        assert amounts == {"amount.worker.vcpu": 3, "amount.worker.memory": -(-memory_for(192 * 128) // 2**20)}
        assert step["script"]["actions"]["onRun"]["args"].count("--accept") == 1
    frames = {each["name"]: each.get("default") for each in template["parameterDefinitions"]}["Frames"]
    assert list(IntRangeExpr.from_str(frames)) == [2, 3, 4, 5]


def test_a_strange_name_is_no_expression_of_a_template(tmp_path):
    shot = write_sequence(tmp_path / "{{Param.Out}} \u2028 ½")
    made = rl.report.write_job(shot, tmp_path / "job")
    template = json.loads((made.folder / "template.json").read_text())
    decode_job_template(template=template, supported_extensions=["TASK_CHUNKING"])
    assert "{{" not in template["name"] and template["name"].startswith("relume insert ")
    assert shlex.split((made.folder / "prepare.txt").read_text())[2] == str(shot)


def test_what_is_there_is_replaced_only_if_it_is_a_job_and_that_is_asked_for(shot, tmp_path):
    job = tmp_path / "job"
    job.mkdir()
    rl.report.write_job(shot, job)
    before = {path.name: path.read_bytes() for path in job.iterdir()}
    with pytest.raises(OutputNotWritten, match=r"a job is there already; .*--force"):
        rl.report.write_job(shot, job, frames="1-2")
    assert {path.name: path.read_bytes() for path in job.iterdir()} == before
    rl.report.write_job(shot, job, frames="1-2", force=True)
    assert (job / "commands.txt").read_text().count("\n") == 1
    for number, content in enumerate(("", "[]", '{"name": "another"}')):
        other = tmp_path / f"other_{number}"
        other.mkdir()
        (other / "template.json").write_text(content)
        with pytest.raises(OutputNotWritten, match="holds other things than a job"):
            rl.report.write_job(shot, other, force=True)
        assert [path.name for path in other.iterdir()] == ["template.json"]


def test_what_would_fail_on_the_farm_fails_here(shot, tmp_path):
    with pytest.raises(ValueError, match=r"frame 11 is not in the shot's \[sequence\], which has 1-9,12-20:2"):
        rl.report.write_job(shot, tmp_path / "job", frames="11")
    with pytest.raises(ValueError, match="chunk is 0"):
        rl.report.write_job(shot, tmp_path / "job", chunk=0)
    with pytest.raises(OutputNotWritten):
        rl.report.write_job(shot, tmp_path / "missing" / "job")
    lacking = tmp_path / "lacking"
    shutil.copytree(shot.parent, lacking)
    (lacking / "objects" / "ball.glb").unlink()
    with pytest.raises(UnreadableFile, match=r"ball.glb: no such file; check the shot file"):
        rl.report.write_job(lacking / "shot.toml", tmp_path / "job")
    assert not (tmp_path / "job").exists()


def test_absolute_paths_are_warned_of_by_their_names(shot, tmp_path):
    folder = tmp_path / "absolute"
    shutil.copytree(shot.parent, folder)
    text = (folder / "shot.toml").read_text()
    (folder / "shot.toml").write_text(text.replace('"light.exr"', f'"{(folder / "light.exr").as_posix()}"'))
    with pytest.warns(UserWarning, match=r"1 absolute path, which every machine must have.*absolute/light\.exr; name"):
        rl.report.write_job(folder / "shot.toml", tmp_path / "job")


# The work


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A shot file and what one command makes of three of its frames."""
    folder = tmp_path_factory.mktemp("alone")
    shot = write_sequence(folder / "shot")
    rl.insert_frames(rl.read_shot(shot), folder / "out", frames="1-2,4")
    return shot, folder / "out"


@pytest.fixture(scope="module")
def whole(alone: tuple[Path, Path]) -> tuple[Path, Path]:
    """The same with all frames and what is made of them together."""
    shot, out = alone
    rl.insert_frames(rl.read_shot(shot), out)
    return shot, out


def test_a_frame_takes_all_but_its_render_from_what_was_prepared(alone, tmp_path):
    shot, out, kept = rl.read_shot(alone[0]), tmp_path / "out", []
    with pytest.warns(UserWarning, match="plate and light come from different files"):
        rl.prepare_shot(shot, out, frame=1)
    assert [path.name for path in out.iterdir()] == ["stages"]

    def finished(result: Inserted, folder: Path) -> None:
        kept.append(result.kept)

    rl.insert_frames(shot, out, frames="4", finished=finished)
    assert kept == [("response", "reflectance", "match")]
    whole = bits(alone[1])
    assert bits(out) == {name: whole[name] for name in whole if name.startswith("frame_0004/")} != {}


def test_the_same_relume_in_another_place_finds_what_was_prepared(tmp_path):
    package = Path(rl.__file__).parent
    shutil.copytree(package, tmp_path / "relume", ignore=shutil.ignore_patterns("__pycache__"))
    code = "from relume.renderers.progressive import fingerprint as f; print(f.__file__, f.fingerprint(f.program()))"
    here, there = (
        run([sys.executable, "-c", code], PYTHONPATH=str(place), PYTHONDONTWRITEBYTECODE="1").stdout.split()
        for place in (package.parent, tmp_path)
    )
    assert here[0] != there[0] and here[1] == there[1]


def test_openjd_runs_the_job_to_its_end_with_mapped_paths_and_the_same_bits(alone, tmp_path):
    # Written by the paths of this machine; the farm has both folders elsewhere, and maps them.
    shot, out, there = tmp_path / "farm" / "shot", tmp_path / "farm" / "pictures", tmp_path / "only" / "here"
    shutil.copytree(alone[0].parent, shot)
    made = rl.report.write_job(alone[0], tmp_path / "job", out=there, frames="1-2", chunk=1)
    template = made.folder / "template.json"
    assert run([BIN / "openjd", "check", template]).returncode == 0
    rules = {
        "version": "pathmapping-1.0",
        "path_mapping_rules": [
            {"source_path_format": "POSIX", "source_path": str(source), "destination_path": str(destination)}
            for source, destination in ((alone[0].parent, shot), (there, out))
        ],
    }
    done = run(
        [BIN / "openjd", "run", template, "-p", f"file://{made.folder / 'openjd_parameters.json'}",
         "--path-mapping-rules", json.dumps(rules)]
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    whole, found = bits(alone[1]), bits(out)
    assert {name: found[name] for name in found if name.startswith("frame_")} == {
        name: whole[name] for name in whole if name.startswith(("frame_0001/", "frame_0002/"))
    }
    assert (out / "report.html").is_file() and "sequence.mp4" in found and not there.exists()
    # What the farm is given of how far it is: no step lacks it.
    assert re.findall(r"openjd_progress: (\d+)", done.stdout)[-1] == "100"
    assert len(re.findall(r"openjd_status: render", done.stdout)) == 2
    assert len(re.findall(r"openjd_status: reflectance", done.stdout)) == 3 and "openjd_fail" not in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("frames", [("1-2", "3-4", "5-6"), ("1-4", "3-6", "1-5:2,6"), ("1-6", "1-6", "1-6")])
def test_processes_that_start_at_once_make_each_frame_once(whole, tmp_path, frames):
    shot, out = whole[0], tmp_path / "out"
    assert run(["relume", "insert", shot, "-o", out, "--prepare"]).returncode == 0
    prepared = {path: path.stat().st_mtime_ns for path in (out / "stages").iterdir()}
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    children = [
        subprocess.Popen(
            ["relume", "insert", shot, "-o", out, "--frames", some, "--accept", "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        )
        for some in frames
    ]  # fmt: skip
    said = [json.loads(child.communicate(timeout=600)[0]) for child in children]
    assert [child.returncode for child in children] == [0, 0, 0]
    assert sum(each["frames"] - each["kept from before"] for each in said) == 6
    assert {path: path.stat().st_mtime_ns for path in (out / "stages").iterdir()} == prepared
    assert not (out / "report.html").exists() and not (out / "sequence.mp4").exists()
    made = rl.insert_frames(rl.read_shot(shot), out)
    assert [frame.kept for frame in made.frames] == [True] * 6 and bits(out) == bits(whole[1])
    assert [path.name for path in out.iterdir() if path.name.startswith(".")] == []


@pytest.mark.slow
def test_a_process_that_is_killed_leaves_its_frame_to_the_next(whole, tmp_path):
    shot, out = whole[0], tmp_path / "out"
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    words = ["relume", "insert", shot, "-o", out, "--frames", "1-6", "--progress", "openjd"]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
    assert child.stdout is not None
    # In the middle of the third frame's render.
    while not re.match(r"openjd_progress: (3[7-9]|4\d)", line := child.stdout.readline()):
        assert line, "ended before"
    child.kill()
    child.communicate()
    assert (out / ".frame_0003.lock").is_file() and not (out / "frame_0003" / "frame.json").exists()
    again = run(["relume", "insert", shot, "-o", out, "--accept", "--json"])
    facts = json.loads(again.stdout)
    assert facts["frames"] == 6 and facts["kept from before"] == 2 and bits(out) == bits(whole[1])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="commands for a POSIX shell")
@pytest.mark.parametrize("way", ["bash", "parallel", "slurm"])
def test_the_lists_of_commands_make_the_same_bits(whole, tmp_path, way):
    made = rl.report.write_job(whole[0], tmp_path / "a job", chunk=2)
    page = (made.folder / "README.md").read_text()
    folder = re.findall(r"^J=.*$", page, re.MULTILINE)[0]
    snippet = {
        "bash": r"^bash .* bash -e .*$",
        "parallel": r"^bash .* parallel --jobs 2 .*$",
        "slurm": r"^prepare=\$\(sbatch(?:.|\n)*?assemble\.txt\"\)\"$",
    }[way]
    commands = re.findall(snippet, page, re.MULTILINE)
    if way == "parallel" and shutil.which("parallel") is None:
        pytest.skip("GNU parallel is not here")
    bin = tmp_path / "bin"
    bin.mkdir()
    # A stand-in that runs what it is given at once, an array element by element.
    (bin / "sbatch").write_text(
        "#!/bin/bash\nset -e\nfor word; do case $word in --array=1-*) last=${word#--array=1-};; esac; done\n"
        'for i in $(seq 1 ${last:-1}); do SLURM_ARRAY_TASK_ID=$i bash -c "${@: -1}" >&2; done\necho 17\n'
    )
    (bin / "sbatch").chmod(0o755)
    done = run(["bash", "-ec", "\n".join([f"PATH={bin}:$PATH", folder, *commands])])
    assert len(commands) == 1 and done.returncode == 0, done.stderr[-3000:]
    assert bits(made.folder / "out") == bits(whole[1])
