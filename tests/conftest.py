"""The sample files beside the repository, for every test that wants real photographs."""

import gc
import os
import shutil
import signal
import sys
import threading
from collections.abc import Generator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

from hanging import HangClock

# The processes of the suite share the cores already. OpenBLAS's threads wait for each other in a loop: where another
# process has a core, a matrix of 256 rows takes a hundred times as long by two threads as by one. Read at NumPy's
# import, by the tests' own child processes too.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A file that a test writes is deleted with it. A disk takes a millisecond for each, memory a hundredth of one, and a
# process of the suite waits for it. Not where memory is scarce: a container has 64 MB there unless it was given more.
MEMORY = Path("/dev/shm")
if MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > 6 << 30:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

# `nohup … &` starts the suite with Ctrl-C ignored, and so the processes that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN and threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Ten seconds of processor time and more: begun last, each would keep one process busy alone. They come first, the
# longest first, whatever the order of the others.
LONGEST = [
    *("test_room_truth.py", "test_outline.py", "test_stage_page.py", "test_merge.py", "test_studio_page.py"),
    *("test_mapped.py", "test_probe.py", "test_single_plate.py", "test_stage_import.py", "test_corpus.py"),
    *("test_mapped_against_path_tracing.py", "test_filters.py", "test_ball.py", "test_render_tiles.py"),
    *("test_insert.py", "test_reflection.py", "test_control_variate.py", "test_mitsuba_insert.py"),
    *("test_capture_report.py", "test_gloss.py", "test_page.py", "test_mitsuba_repeats.py", "test_glossy.py"),
    *("test_studio_camera.py", "test_studio_radiance.py", "test_studio_faults.py", "test_patches.py"),
    *("test_resampling.py", "test_studio_light_edits.py", "test_farm_job.py", "test_round_matching.py"),
    *("test_architecture.py", "test_assembled.py", "test_probe_films.py", "test_consistency.py"),
    *("test_page_sizes.py", "test_shot_in_fog.py", "test_shining_shot.py"),
    *("test_registration.py", "test_reflect.py", "test_measurement.py", "test_panorama.py"),
]
# What `make quick` leaves out: what renders with Mitsuba, runs whole commands and shots, or takes more than 5 s.
LONG = (
    *(
        "studio/page/*",
        "studio/test_*page.py",
        "studio/test_shot_server.py",
        "studio/test_ray_trees.py",
        "studio/test_studio_*.py",
    ),
    *(
        "cli/*",
        "export/*",
        "project/*",
        "report/*",
        "physics/*",
        "image/test_corpus*",
        "test_examples.py",
        "test_architecture.py",
    ),
    *("renderers/*mitsuba*", "renderers/test_renderer.py", "renderers/test_environment.py", "renderers/test_sheet.py"),
    "renderers/test_measured_surfaces.py",
    *("renderers/test_accumulation.py", "renderers/test_allocation.py", "renderers/test_filters.py"),
    *("renderers/test_mapped.py", "renderers/test_whitted_paper.py", "renderers/test_whitted_materials.py"),
    *("renderers/test_miller_hoffman.py", "renderers/test_material_balls.py"),
    *("composite/test_reflectance.py", "composite/test_gloss.py", "scene/test_moving.py", "scene/test_grid.py"),
    *("probe/test_outline.py", "probe/test_registration.py", "probe/test_ball.py", "probe/test_assembled.py"),
    *("probe/test_silhouette.py", "probe/test_panorama.py", "light/test_reflection.py", "light/test_glossy.py"),
    *("capture/test_*accuracy.py", "capture/test_raw_measurement.py", "capture/test_measurement.py"),
    *("capture/test_consistency.py", "capture/test_response.py", "capture/test_deghosting.py"),
    *("image/test_logluv_tiff.py", "image/test_every_format.py", "virtual_camera/lens/glare/test_eye.py"),
    *(
        "renderers/test_antialiasing.py",
        "renderers/test_patches.py",
        "sphere/test_blur.py",
        "sphere/test_resampling.py",
        "virtual_camera/lens/glare/test_camera.py",
        "virtual_camera/lens/motion/test_figure_9.py",
        "virtual_camera/plate_matching/test_grain_measuring.py",
        "virtual_camera/plate_matching/test_sharpness.py",
        "test_readme.py",
        "documents/test_*_blocks.py",
    ),
    *("lightstage/*/test_measured_view.py", "lightstage/*/test_environment_matte.py"),
    *("lightstage/geometry/test_calibration.py", "lightstage/geometry/test_scan.py"),
    *("lightstage/geometry/test_merging.py", "lightstage/*/test_patch_fit.py", "lightstage/test_object_storage.py"),
    *("composite/test_varying_gloss.py", "probe/video/test_probe_films.py", "probe/test_mirror_edge.py"),
    *("renderers/test_inside_bodies.py", "cluster/test_files.py", "cluster/test_stills.py"),
    "studio/test_dropped_meshes.py",
    *("lightstage/*/test_control_variate.py", "lightstage/*/test_head_truth.py", "lightstage/*/test_read_stage.py"),
    *("test_course.py", "test_warning_page.py", "studio/places/*", "studio/test_server.py", "studio/test_words.py"),
    *("scene/places/*", "scene/test_rolling_shutter.py", "image/test_kept_kernels.py", "image/test_video.py"),
    *("light/test_sun.py", "light/daylight/test_hosek_wilkie.py", "probe/test_round_matching.py"),
    *("probe/test_unwrapping.py", "composite/test_several_plates.py", "composite/test_borders.py"),
    *("cluster/test_lost_workers.py", "cluster/test_one_variant.py", "cluster/test_run_tasks.py"),
    *("cluster/test_users.py", "lightstage/test_blocks.py", "lightstage/acquire/test_store.py"),
    *("lightstage/relighting/test_relighting.py", "capture/test_vignetting.py", "capture/test_raw_merging.py"),
    *("capture/test_saturation.py", "capture/test_noise.py", "capture/test_white_balance.py"),
    *("renderers/test_refusals.py", "renderers/test_several_probes.py", "renderers/test_projective_texture.py"),
    *("renderers/test_photon_map.py", "renderers/test_baked_place.py", "renderers/test_radiosity.py"),
    *("virtual_camera/tone/test_operators_agree.py", "virtual_camera/plate_matching/test_camera_matching.py"),
    *("virtual_camera/lens/motion/test_path.py", "virtual_camera/lens/glare/test_convolution.py"),
)
SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of sample files beside the repository; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip(f"the sample files in {SHARED} are not here")
    return SHARED


def pytest_configure(config: pytest.Config) -> None:
    # What the tests write need not outlive a power cut: 8 ms for each file and its folder. tests/image/test_atomic.py
    # has the real one.
    os.fsync = lambda fd: None
    # A test that waits for ever ends the process that runs it, which says where; the others go on.
    config.pluginmanager.register(HangClock(os.dup(2)))
    if "PYTEST_XDIST_WORKER" in os.environ:
        config.pluginmanager.register(SharedCollection())
    if "not long" in config.option.markexpr:
        sys.modules["mitsuba"] = None  # pyright: ignore[reportArgumentType]  # to import it is an error then
    elif int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) >= (os.cpu_count() or 1):
        # Dr.Jit's threads wait for work in a loop too. Tests of the number of threads set it themselves.
        import drjit

        drjit.set_thread_count(1)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """`make quick` does not even read the files that it leaves out."""
    if "not long" in config.option.markexpr and _is_long(collection_path):
        return True
    return None


@cache
def _is_long(path: Path) -> bool:
    within = path.relative_to(Path(__file__).parent).as_posix()
    return any(fnmatch(within, pattern) for pattern in LONG)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Ten thousand tests stay to the end: to look through them for garbage again and again takes three seconds.

    So does what the modules hold: to look ten times as rarely takes a thirtieth from a command's tests.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(5_000, 10, 10)
        gc.enable()


class SharedCollection:
    """In a fresh clone each process compiles what the other has not: one begins at the first file, one at the last."""

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        report = yield
        if isinstance(collector, pytest.Directory) and os.environ["PYTEST_XDIST_WORKER"] == "gw1":
            report.result = [*reversed(report.result)]
        return report

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Generator[None, None, None]:
        # The processes have to name the tests in the same order, before it is made a random one.
        items.sort(key=lambda item: item.path)
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "mitsuba" in item.name or _is_long(item.path):
            item.add_marker("long")
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))
