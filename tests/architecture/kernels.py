"""What proves each compiled kernel: a test that reaches it through its front door.

A kernel cannot be stepped through, and its flags let sums be reordered. So each module of kernels names here the test
that holds it against something that is not compiled: a slow twin (the same in plain Python or NumPy), a closed form,
or an identity such as light that is neither made nor lost.
"""

from __future__ import annotations

import ast
from pathlib import Path

from architecture.tree import functions, imported_modules, imports, is_kernel, modules, parsed

PROOFS: dict[str, tuple[str, str]] = {
    "capture/alignment/border_kernel.py": ("capture/test_warping.py", "closed forms of what lies outside"),
    "capture/alignment/clipped_blocks.py": ("capture/test_warping.py", "identity: every block taken for a mixed one"),
    "capture/alignment/kernel.py": ("capture/test_alignment.py", "slow twins of the loops"),
    "capture/alignment/reducing_kernel.py": ("capture/test_alignment.py", "slow twins by NumPy"),
    "capture/alignment/warping_kernel.py": ("capture/test_warping.py", "slow twin: sixteen pixels at one position"),
    "capture/denoising_kernel.py": ("capture/test_denoising.py", "slow twin: SciPy's transforms, block by block"),
    "capture/ghosts/kernel.py": ("capture/test_deghosting.py", "closed forms of what moved and what did not"),
    "capture/merge_kernel.py": ("capture/test_merging.py", "slow twin: equation 6, pixel by pixel"),
    "capture/raw/demosaic.py": ("capture/test_demosaic.py", "closed forms: ramps and flat mosaics come back"),
    "capture/raw/kernel.py": ("capture/test_raw_merging.py", "slow twin"),
    "image/files/gain_map/applying.py": ("image/test_gain_map.py", "the same photograph in PQ, by another program"),
    "image/files/hdr/kernels.py": ("image/test_radiance_scanlines.py", "slow twins and bytes written by hand"),
    "image/files/logluv/kernels.py": ("image/test_logluv_codes.py", "slow twin in naive_logluv.py"),
    "light/constellations/cells.py": ("light/test_constellation.py", "slow twin in naive.py"),
    "light/constellations/k_means.py": ("light/test_constellation.py", "slow twin in naive.py"),
    "light/reflection/glossy_lookup.py": ("light/test_glossy.py", "slow twin in naive.py: the integral"),
    "light/reflection/hemisphere.py": ("light/test_reflection.py", "slow twin in naive.py: the sum over all pixels"),
    "light/sampling.py": ("light/test_sampling.py", "χ² against the density"),
    "lightstage/direct_light/shading_kernel.py": (
        "lightstage/direct_light/test_direct_surface.py",
        "slow twin in NumPy",
    ),
    "lightstage/matting/kernel.py": (
        "lightstage/matting/test_matte_composite.py",
        "slow twin of the summed-area table",
    ),
    "lightstage/relighting/sum_kernel.py": ("lightstage/relighting/test_relighting.py", "identity: the matrix product"),
    "probe/descent.py": ("probe/test_descent.py", "slow twins: the same sums by NumPy, descended by SciPy"),
    "probe/panorama/kernel.py": ("probe/test_panorama_parts.py", "identity: views of one light give it back"),
    "renderers/irradiance_cache/octree.py": ("renderers/test_irradiance_cache.py", "slow twin: every record is tried"),
    "renderers/prefiltered/filter_kernels.py": ("renderers/test_filters.py", "identity: light is kept; slow quads"),
    "renderers/prefiltered/glossy_kernel.py": ("renderers/test_mapped.py", "closed forms of albedo"),
    "renderers/prefiltered/plain_kernel.py": ("renderers/test_filters.py", "slow twin: EnvironmentMap.lookup"),
    "renderers/prefiltered/shading_inputs.py": ("renderers/test_filters.py", "slow quadrilaterals in quads.py"),
    "renderers/raytrace/bvh.py": ("renderers/test_raycast.py", "slow twin: every triangle is tried"),
    "renderers/raytrace/kernel.py": ("renderers/test_raycast.py", "slow twin in naive.py"),
    "renderers/raytrace/parallel_kernel.py": ("renderers/test_parallel_light.py", "slow twin in naive.py"),
    "renderers/raytrace/patch_kernel.py": ("renderers/test_patches.py", "slow twin in naive.py"),
    "renderers/raytrace/patch_leaves.py": ("renderers/test_patches.py", "the normals of many points of each leaf"),
    "renderers/raytrace/patch_point.py": ("renderers/test_patches.py", "slow twin in naive.py"),
    "renderers/raytrace/polygon_kernel.py": ("renderers/test_polygons.py", "slow twin in naive.py"),
    "renderers/raytrace/primitives.py": ("renderers/test_raycast.py", "slow twin in naive.py"),
    "renderers/raytrace/raycast.py": ("renderers/test_raycast.py", "slow twin in naive.py"),
    "renderers/raytrace/surface.py": ("renderers/test_raycast.py", "closed forms of normals and places"),
    "renderers/whitted/antialiasing.py": ("renderers/test_antialiasing.py", "closed form: the covered share"),
    "renderers/whitted/kernel.py": ("renderers/test_whitted_paper.py", "slow twin in naive_whitted.py"),
    "renderers/whitted/optics.py": ("renderers/test_whitted_paper.py", "slow twin in naive_whitted.py"),
    "sphere/bilinear_kernels.py": ("sphere/test_bilinear_kernels.py", "closed forms"),
    "sphere/mappings/kernels.py": ("sphere/test_environment_map.py", "slow twin in naive.py"),
    "sphere/resampling/kernels.py": ("sphere/test_resampling.py", "slow twin: 16 × 16 look-ups a pixel"),
    "sphere/resampling/splatting.py": ("sphere/test_resampling.py", "slow twin: 16 × 16 look-ups a pixel"),
    "virtual_camera/film/float_table.py": ("virtual_camera/film/test_float_table.py", "the function itself"),
    "virtual_camera/film/grain_kernels.py": (
        "virtual_camera/film/test_correlated_noise.py",
        "moments of the distribution",
    ),
    "virtual_camera/film/printing_kernel.py": ("virtual_camera/film/test_darkroom.py", "slow twin in float64"),
    "virtual_camera/lens/defocus_kernels.py": ("virtual_camera/lens/test_defocus_blur.py", "slow twin"),
    "virtual_camera/lens/disc_table.py": ("virtual_camera/lens/test_disc_table.py", "closed form: areas of discs"),
    "virtual_camera/lens/disocclusion.py": ("virtual_camera/lens/test_disocclusion.py", "closed forms"),
    "virtual_camera/lens/geometry_kernels.py": ("virtual_camera/lens/test_geometry.py", "slow twin"),
    "virtual_camera/lens/glare/point_spread.py": ("virtual_camera/lens/glare/test_point_spread.py", "slow twin"),
    "virtual_camera/lens/motion/kernels.py": (
        "virtual_camera/lens/motion/test_path.py",
        "slow twin in naive_motion.py",
    ),
    "virtual_camera/lens/motion/splats.py": (
        "virtual_camera/lens/motion/test_vectors.py",
        "slow twin in naive_motion.py",
    ),
    "virtual_camera/tone/display/code_table_kernels.py": (
        "virtual_camera/tone/display/test_code_table.py",
        "slow twin",
    ),
    "virtual_camera/tone/histogram/kernels.py": (
        "virtual_camera/tone/test_histogram.py",
        "the paper's algorithm in NumPy",
    ),
    "virtual_camera/tone/luminance_kernels.py": ("virtual_camera/tone/test_luminance_statistics.py", "slow twins"),
    "virtual_camera/tone/pattanaik/kernels.py": ("virtual_camera/tone/test_pattanaik.py", "slow twin"),
    "virtual_camera/tone/pattanaik/pyramid.py": ("virtual_camera/tone/test_pattanaik_pyramid.py", "slow twin"),
    "virtual_camera/tone/reinhard_local_kernel.py": ("virtual_camera/tone/test_reinhard.py", "slow twin"),
}


def kernels_without_proof(package: Path, tests: Path, proofs: dict[str, tuple[str, str]]) -> list[str]:
    """Modules with kernels that name no test, or one that is gone or does not reach them; names of no kernels."""
    arrows = imported_modules(package)
    compiled = {path for path, tree in modules(package) if any(is_kernel(node) for _, node in functions(tree))}
    faults = [f"{path}: has no kernels; take it off the table" for path in sorted(set(proofs) - compiled)]
    for path in sorted(compiled):
        test, how = proofs.get(path, ("", ""))
        if not how:
            faults.append(f"{path}: name the test that proves its kernels in tests/architecture/kernels.py")
        elif not (tests / test).is_file():
            faults.append(f"{path}: its proof {test} is gone")
        elif path not in reached_from(tests / test, package, arrows):
            faults.append(f"{path}: its proof {test} does not reach it")
    return faults


def reached_from(test: Path, package: Path, arrows: dict[str, set[str]]) -> set[str]:
    """Every module that a test imports, directly or by way of others."""
    tree: ast.Module = parsed(test.read_text(encoding="utf-8"))
    waiting = []
    for _, name in imports(test.name, tree, "tests"):
        parts = name.split(".")
        if parts[0] == package.name:
            for count in range(1, len(parts) + 1):
                place = "/".join(parts[1:count])
                waiting += [each for each in (f"{place}.py", f"{place}/__init__.py".lstrip("/")) if each in arrows]
    reached: set[str] = set()
    while waiting:
        here = waiting.pop()
        if here not in reached:
            reached.add(here)
            waiting += arrows[here]
    return reached
