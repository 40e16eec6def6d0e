"""A job as a folder: the template and what submits it, lists of commands for farms without OpenJD, and a README.

`parameter_values.json` and `asset_references.json` have the form of a job bundle of AWS Deadline Cloud.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

from relume.errors import OutputNotWritten
from relume.export.openjd.template import MAKER, Job, template_of
from relume.export.shot_files import complete_folder
from relume.image import files
from relume.project.shot_file.sequence_table import frames_as_text

_TEMPLATE, _PREPARE, _COMMANDS, _ASSEMBLE = "template.json", "prepare.txt", "commands.txt", "assemble.txt"


def write_bundle(job: Job, folder: Path, inputs: Sequence[Path], force: bool = False) -> None:
    """Write the folder, whole or not at all; raises OutputNotWritten where something is there already.

    inputs : absolute, the files and folders that the shot names
    force : replace a job of ours
    """
    _require_free(folder, force)
    values = {"Shot": str(job.shot), "Out": str(job.out), "Frames": frames_as_text(job.frames)}
    references = {
        "inputs": {
            "filenames": sorted(str(path) for path in {job.shot, *inputs} if not path.is_dir()),
            "directories": sorted(str(path) for path in set(inputs) if path.is_dir()),
        },
        "outputs": {"directories": [str(job.out)]},
        "referencedPaths": [],
    }
    contents: dict[str, Any] = {
        _TEMPLATE: template_of(job),
        "parameter_values.json": {"parameterValues": [{"name": n, "value": v} for n, v in values.items()]},
        "openjd_parameters.json": values,
        "asset_references.json": {"assetReferences": references},
    }
    lines = _lines(job)
    with complete_folder(folder, _TEMPLATE) as temporary:
        for name, content in contents.items():
            files.write_text(temporary / name, json.dumps(content, indent=2, ensure_ascii=False) + "\n")
        for name, commands in lines.items():
            files.write_text(temporary / name, "".join(f"{line}\n" for line in commands))
        files.write_text(temporary / "README.md", _readme(job, folder))


def _lines(job: Job) -> dict[str, list[str]]:
    """The commands of each list, as a shell reads them."""
    shot, out = str(job.shot), str(job.out)
    words = {
        _PREPARE: [job.prepare(shot, out)],
        _COMMANDS: [job.make(shot, out, chunk) for chunk in job.chunks],
        _ASSEMBLE: [job.assemble(shot, out, frames_as_text(job.frames))],
    }
    return {name: [shlex.join(["relume", *each]) for each in some] for name, some in words.items()}


def _require_free(folder: Path, force: bool) -> None:
    """Refuse a folder that holds something else, or a job that is not to be replaced."""
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    try:
        ours = str(json.loads((folder / _TEMPLATE).read_text(encoding="utf-8"))["name"]).startswith(MAKER)
    except (OSError, ValueError, KeyError, TypeError):
        ours = False
    if not ours:
        raise OutputNotWritten(f"{folder}: holds other things than a job; choose another name")
    if not force:
        raise OutputNotWritten(
            f"{folder}: a job is there already; choose another name, or force (--force) to replace it"
        )


def _readme(job: Job, folder: Path) -> str:
    frames = frames_as_text(job.frames)
    # Deadline gives the ends of a task's frames alone.
    gapless = job.frames[-1] - job.frames[0] + 1 == len(job.frames)
    return Template(_README).substitute(
        name=job.name, count=len(job.frames), frames=frames, frames_x=frames.replace(":", "x"),
        deadline_chunk=job.chunk if gapless else 1, tasks=len(job.chunks), chunk=job.chunk,
        memory=job.megabytes, gigabytes=-(-job.megabytes // 1024), cores=job.settings.threads or 1,
        folder=shlex.quote(str(folder.absolute())),
        shot=job.shot, out=job.out,
        options="".join(f" {word}" for word in job.settings.words()),
    )  # fmt: skip


_README = """\
# $name

$count frames ($frames) in $tasks tasks of up to $chunk. A task takes about $memory MiB of memory.

| | |
|---|---|
| shot | `$shot` |
| pictures | `$out` |

Every machine needs the same version of relume and of its libraries, the same kind of processor (all by CUDA or all
by LLVM), and both paths: frames are kept under a hash of all that made them.

Three things are done, each after the one before:

1. `prepare.txt` measures light, camera and reflectance, once.
2. Each line of `commands.txt` makes some frames. They run in any order, at the same time, on any machines; a line
   given twice makes nothing twice, and one that was stopped goes on where it was when it is given again.
3. `assemble.txt` checks that all frames are there and writes the movie and the report.

Exit codes: 0 done, 2 bad input, 3 output could not be written, 4 doubtful, or frames are missing.

In the commands below, J is this folder:

```sh
J=$folder
```

## Open Job Description

```sh
openjd check "$$J/template.json"
openjd run "$$J/template.json" -p "file://$$J/openjd_parameters.json"
```

Where paths differ, the farm maps Shot and Out; `--path-mapping-rules` does it here. What the shot names is found
beside it.

## AWS Deadline Cloud

```sh
deadline bundle submit "$$J"
```

`parameter_values.json` and `asset_references.json` are read from the folder.

## One machine, or GNU parallel

```sh
bash "$$J/prepare.txt" && bash -e "$$J/commands.txt" && bash "$$J/assemble.txt"
bash "$$J/prepare.txt" && parallel --jobs 2 < "$$J/commands.txt" && bash "$$J/assemble.txt"
```

## Slurm

```sh
prepare=$$(sbatch --parsable --mem=${memory}M --cpus-per-task=$cores --wrap "$$(cat "$$J/prepare.txt")")
frames=$$(sbatch --parsable --mem=${memory}M --cpus-per-task=$cores --dependency=afterok:$$prepare \\
    --array=1-$tasks --wrap "eval \\"\\$$(sed -n \\"\\$${SLURM_ARRAY_TASK_ID}p\\" '$$J/commands.txt')\\"")
sbatch --mem=${memory}M --cpus-per-task=$cores --dependency=afterok:$$frames --wrap "$$(cat "$$J/assemble.txt")"
```

## OpenCue

```sh
bash "$$J/prepare.txt"
cuecmd "$$J/commands.txt" --chunk 1 --memory $gigabytes
bash "$$J/assemble.txt"                    # when the job is done
```

## Deadline 10

```sh
bash "$$J/prepare.txt"
deadlinecommand -SubmitCommandLineJob -name "$name" -executable relume -frames $frames_x -chunksize $deadline_chunk \\
    -arguments "insert <QUOTE>$shot<QUOTE> -o <QUOTE>$out<QUOTE>$options --frames <STARTFRAME>-<ENDFRAME> --accept"
bash "$$J/assemble.txt"                    # when the job is done
```
"""
