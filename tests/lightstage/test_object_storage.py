"""Stores at URLs: an object store started here, memory, and what goes wrong with them, each in one line."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import stage_blocks
from command_line import printed, refused
from relume.errors import OutputNotWritten, UnreadableFile
from relume.image import files
from relume.lightstage.acquire.import_stage import import_stage
from relume.lightstage.acquire.read_stage import read_stage
from relume.lightstage.acquire.store import is_store, read_store, stored_geometry
from relume.lightstage.acquire.store_building import build_store
from relume.lightstage.field.field import whole
from relume.lightstage.relighting.relight import relight
from relume.lightstage.relighting.relight_settings import RelightSettings

pytest.importorskip("zarr", reason="the extra lightstage is not installed")
fsspec = pytest.importorskip("fsspec", reason="the extra lightstage is not installed")

FIELD = stage_blocks.ball(40)
LIGHT = stage_blocks.light()


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """The address of an S3-like server on this machine, in a process of its own; whoever is started after knows it."""
    pytest.importorskip("moto", reason="moto is not installed")
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert server.stdout is not None
    port = server.stdout.readline().strip()
    known = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    before = {name: os.environ.get(name) for name in known}
    os.environ.update(known)
    try:
        yield known["AWS_ENDPOINT_URL"]
    finally:
        server.kill()
        server.wait()
        server.stdout.close()
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


SERVER = """
from moto.server import ThreadedMotoServer
server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
server.start()
print(server.get_host_and_port()[1], flush=True)
import threading
threading.Event().wait()
"""


@pytest.fixture(scope="module")
def bucket(endpoint) -> str:
    import s3fs

    s3fs.S3FileSystem(skip_instance_cache=True).mkdir("stages")
    return "s3://stages"


@pytest.fixture(scope="module")
def local(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("stages") / "ball.zarr"
    build_store(FIELD, path)
    return path


def test_a_store_in_a_bucket_is_the_store_in_a_folder(bucket, local):
    url = f"{bucket}/ball.zarr"
    build_store(FIELD, url, light_radius=0.01)
    assert is_store(url) and not is_store(f"{bucket}/none.zarr")
    np.testing.assert_array_equal(whole(read_stage(url)), whole(read_stage(local)))
    assert stored_geometry(url) == (None, 0.01)
    found, expected = relight(url, LIGHT), relight(local, LIGHT)
    np.testing.assert_array_equal(found.radiance, expected.radiance)
    np.testing.assert_array_equal(found.variance, expected.variance)
    with pytest.raises(OutputNotWritten, match="whole already"):
        build_store(FIELD, url)


@pytest.mark.slow
def test_workers_import_to_a_bucket_and_relight_from_it_with_a_bucket_as_their_only_shared_place(bucket, local):
    pytest.importorskip("distributed", reason="Dask distributed is not installed")
    url = f"{bucket}/by_workers.zarr"
    from relume.cluster import connect

    with connect("local:2") as two:
        import_stage(local, url, cluster=two)
        np.testing.assert_array_equal(whole(read_store(url)), whole(read_store(local)))
        found = relight(url, LIGHT, settings=RelightSettings(scratch=f"{bucket}/scratch"), cluster=two)
    np.testing.assert_array_equal(found.radiance, relight(local, LIGHT).radiance)
    assert not fsspec.filesystem("s3", skip_instance_cache=True).find("stages/scratch")


def test_an_import_to_a_bucket_that_was_cut_short_is_refused_and_goes_on(bucket):
    url, broken = f"{bucket}/short.zarr", stage_blocks.Failing(FIELD, range(39, 40))
    with pytest.raises(ValueError, match="this part of the disk is lost"):
        build_store(broken, url)
    with pytest.raises(UnreadableFile, match="not whole, 1 of its 2 groups of lights are missing"):
        read_store(url)
    build_store(FIELD, url)
    system = fsspec.filesystem("s3", skip_instance_cache=True)
    lost = system.find("stages/short.zarr/values")[3]
    system.rm(lost)
    with pytest.raises(UnreadableFile, match="not whole, 1 of its 2 groups of lights are missing or cut short"):
        read_store(url)


def test_the_command_reads_and_writes_urls(bucket, local, tmp_path, capsys):
    url, lamp = f"{bucket}/command.zarr", ["--direction", "0,1,1", "-o"]
    printed(["stage", "import", local, "-o", url, "-q"], capsys)
    printed(["stage", "relight", url, *lamp, tmp_path / "a.exr", "-q"], capsys)
    printed(["stage", "relight", local, *lamp, tmp_path / "b.exr", "-q"], capsys)
    found, expected = (files.read_radiance(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert found.radiance.max() > 0
    np.testing.assert_array_equal(found.radiance, expected.radiance)


CONNECTIONS: list[dict[object, object]] = []
"""Of `unconnected`, to the end of the process as s3fs keeps its own: one that is dropped complains that it was open."""


def unconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a process of its own: no connection that was made is used, nor is what this test makes used by others."""
    s3fs = pytest.importorskip("s3fs", reason="s3fs is not installed")
    CONNECTIONS.append({})
    monkeypatch.setattr(s3fs.S3FileSystem, "_cache", CONNECTIONS[-1])


def test_a_missing_bucket_and_refused_credentials_are_one_line_each(bucket, tmp_path, capsys, monkeypatch):
    nowhere = "s3://nobody-has-this/a.zarr"
    said = refused(["stage", "relight", nowhere, "--direction", "0,1,0", "-o", tmp_path / "a.exr"], capsys)
    assert "there is no bucket nobody-has-this; check the name, or make it first" in said
    with pytest.raises(UnreadableFile, match=r"none\.zarr: there is no such store"):
        read_store(f"{bucket}/none.zarr")
    with pytest.raises(OutputNotWritten, match="there is no bucket nobody-has-this"):
        build_store(FIELD, nowhere)
    # No credentials anywhere.
    unconnected(monkeypatch)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(UnreadableFile, match="no credentials for it are found; give them as fsspec expects them") as no:
        read_store(f"{bucket}/ball.zarr")
    assert "\n" not in str(no.value)


def test_a_storage_that_does_not_answer_is_one_line(endpoint, monkeypatch):
    unconnected(monkeypatch)
    monkeypatch.setitem(fsspec.config.conf, "s3", {"config_kwargs": {"retries": {"max_attempts": 0}}})
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(
        UnreadableFile, match=r"^s3://stages/ball\.zarr: the storage does not answer as it should"
    ) as no:
        read_store("s3://stages/ball.zarr")
    assert "\n" not in str(no.value)


def test_memory_and_file_urls_are_stores_too(local, tmp_path):
    build_store(FIELD, "memory://relume-tests/ball.zarr")
    np.testing.assert_array_equal(whole(read_store("memory://relume-tests/ball.zarr")), whole(read_store(local)))
    build_store(FIELD, f"file://{tmp_path}/ball.zarr")
    np.testing.assert_array_equal(whole(read_store(tmp_path / "ball.zarr")), whole(read_store(local)))
    np.testing.assert_array_equal(whole(read_store(f"file://{local}")), whole(read_store(local)))
    with pytest.raises(ValueError, match="no worker sees the memory of this process"):
        build_store(FIELD, "memory://relume-tests/other.zarr", cluster="local:2")


def test_what_is_not_installed_or_not_known_is_named(monkeypatch):
    with pytest.raises(ValueError, match=r"teapot://a/b: .*teapot.*; give a URL that fsspec knows"):
        read_store("teapot://a/b")
    # As where it was never imported: fsspec keeps the classes that it has found.
    monkeypatch.setitem(sys.modules, "s3fs", None)
    monkeypatch.delitem(sys.modules["fsspec.registry"]._registry, "s3", raising=False)
    with pytest.raises(ValueError, match=r"^s3://stages/ball\.zarr: .*nstall s3fs.*with pip") as said:
        read_store("s3://stages/ball.zarr")
    assert "\n" not in str(said.value)
