"""Movies read back by PyAV: their number of frames, size, colours and rate, and what failure leaves behind."""

import sys
import warnings
from fractions import Fraction

import numpy as np
import pytest

from relume.errors import OutputNotWritten, UnreadableFile, doubt_of
from relume.image.files.video import VIDEOS, Movie, read_video, read_video_frame, video_frames

av = pytest.importorskip("av")

TOP, BOTTOM = (200, 60, 30), (20, 120, 240)


def halves(height=48, width=64, shift=0):
    """Two colours above each other, the lower one brighter by `shift`."""
    frame = np.empty((height, width, 3), np.uint8)
    frame[: height // 2] = TOP
    frame[height // 2 :] = np.add(BOTTOM, (shift, 0, 0))
    return frame


def written(path, frames, **options):
    with Movie(path, **options) as movie:
        for frame in frames:
            movie.add(frame)
    return path


def played(path):
    """The frames (N, H, W, 3) as a player shows them, and the video stream's own description."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [frame.reformat(format="rgb24").to_ndarray() for frame in container.decode(stream)]
        codec = stream.codec_context
        tags = codec.color_primaries, codec.color_trc, codec.colorspace, codec.color_range
        return np.stack(frames), {"rate": stream.average_rate, "codec": codec.name, "format": codec.pix_fmt}, tags


def test_frames_come_back_in_number_order_size_and_colour(tmp_path):
    frames, about, tags = played(written(tmp_path / "a.mp4", [halves(shift=8 * i) for i in range(10)]))
    assert frames.shape == (10, 48, 64, 3)
    assert about == {"rate": 24, "codec": "h264", "format": "yuv420p"}
    assert tags == (1, 1, 1, 1)  # BT.709 primaries, transfer and matrix, limited range
    for i, frame in enumerate(frames):
        assert frame[:20].mean((0, 1)) == pytest.approx(TOP, abs=3)
        assert frame[28:].mean((0, 1)) == pytest.approx((20 + 8 * i, 120, 240), abs=3)


@pytest.mark.parametrize("colour", [(0, 0, 0), (255, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255), (119, 119, 119)])
def test_primaries_black_and_white_keep_their_colour(tmp_path, colour):
    frames, _, _ = played(written(tmp_path / "a.mp4", [np.full((32, 32, 3), colour, np.uint8)] * 2))
    assert frames.mean((0, 1, 2)) == pytest.approx(colour, abs=3)


@pytest.mark.parametrize("rate", [30, 12.5, Fraction(24000, 1001)])
def test_the_rate_is_kept(tmp_path, rate):
    _, about, _ = played(written(tmp_path / "a.mp4", [halves()] * 5, frames_per_second=rate))
    assert about["rate"] == Fraction(rate)


def test_an_odd_size_gains_a_row_and_a_column_like_the_last(tmp_path):
    frame = halves(47, 63)
    frame[-1] = 255
    frames, _, _ = played(written(tmp_path / "a.mp4", [frame] * 3))
    assert frames.shape == (3, 48, 64, 3)
    assert frames[:, -2:].mean() == pytest.approx(255, abs=6)


def test_an_error_in_the_block_leaves_nothing_behind_and_passes_through(tmp_path):
    for error in (RuntimeError("render"), FileNotFoundError(2, "no such frame"), KeyboardInterrupt()):
        with pytest.raises(type(error)) as caught, Movie(tmp_path / "a.mp4") as movie:
            movie.add(halves())
            raise error
        assert caught.value is error
        assert list(tmp_path.iterdir()) == []


def test_a_failed_movie_leaves_the_old_one(tmp_path):
    path = written(tmp_path / "a.mp4", [halves()])
    before = path.read_bytes()
    with pytest.raises(RuntimeError), Movie(path) as movie:
        movie.add(halves())
        raise RuntimeError
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_seen_under_the_name_before_the_end(tmp_path):
    with Movie(tmp_path / "a.mp4") as movie:
        movie.add(halves())
        assert not (tmp_path / "a.mp4").exists()
    assert (tmp_path / "a.mp4").exists()


@pytest.mark.parametrize(
    "frame",
    [halves(48, 62), halves(46, 64), halves().astype(np.float32), halves()[..., 0], np.zeros((0, 64, 3), np.uint8)],
)
def test_a_frame_that_does_not_fit_is_refused(tmp_path, frame):
    with pytest.raises(ValueError, match="a frame is"), Movie(tmp_path / "a.mp4") as movie:
        movie.add(halves())
        movie.add(frame)
    assert list(tmp_path.iterdir()) == []


def test_a_movie_without_frames_is_refused(tmp_path):
    with pytest.raises(ValueError, match="without frames"), Movie(tmp_path / "a.mp4"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_reported(tmp_path):
    with pytest.raises(OutputNotWritten, match="does not exist"), Movie(tmp_path / "none" / "a.mp4"):
        pass


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/dev/full is Linux's")
def test_a_full_disk_is_reported(tmp_path):
    with pytest.raises(OutputNotWritten, match=r"a\.mp4: cannot be written"), Movie(tmp_path / "a.mp4") as movie:
        movie._temporary.unlink()
        movie._temporary.symlink_to("/dev/full")
        movie.add(halves())
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_call_is_reported(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"written to \.mp4"):
        Movie(tmp_path / "a.avi")
    with pytest.raises(ValueError, match="frames_per_second is 0"):
        Movie(tmp_path / "a.mp4", frames_per_second=0)
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ValueError, match=r'pip install "relume\[video\]"'):
        Movie(tmp_path / "a.mp4")


def test_a_video_is_read_picture_by_picture(tmp_path):
    path = written(tmp_path / "a.mp4", [halves(shift=5 * index) for index in range(30)], frames_per_second=25)
    facts = read_video(path)
    assert (facts.frames, facts.rate, facts.size) == (30, 25, (64, 48))
    for number in (1, 13, 30, 2):
        read = read_video_frame(path, number)
        assert np.abs(read.pixels[10, 30].astype(int) - TOP).max() <= 2
        assert abs(int(read.pixels[40, 30, 0]) - (20 + 5 * (number - 1))) <= 2 and f"frame {number}" in read.name
    with pytest.raises(UnreadableFile, match=r"a\.mp4: it has the frames 1 to 30, and frame 31 was asked for"):
        read_video_frame(path, 31)


CODECS = {
    ".webm": ("libvpx-vp9", {}),
    ".mpg": ("mpeg1video", {}),
    ".mpeg": ("mpeg2video", {}),
    ".mxf": ("mpeg2video", {}),
}
"""Of the containers that do not take H.264."""
OPEN = {"x264-params": "open-gop=1:keyint=6:min-keyint=3:scenecut=0"}


def encoded(path, codec="libx264", options=None, count=28, apart=12):
    """A video of pictures that all differ, with pictures between others and key pictures about so many apart."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options or {})
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        stream.codec_context.gop_size, stream.codec_context.max_b_frames = apart, 2
        for number in range(count):
            frame = np.full((64, 96, 3), (6 * number, 40, 40), np.uint8)
            frame[10:50, number * 7 % 80 :][:, :12, 1] = 200
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode())
    return path


def assert_read_as_all_are(path, count):
    frames = list(video_frames(path))
    assert len({frame.tobytes() for frame in frames}) == read_video(path).frames == count
    for number in (*range(1, count + 1), *range(count, 0, -1)):
        assert np.array_equal(read_video_frame(path, number).pixels, frames[number - 1]), number


@pytest.mark.parametrize(
    ("suffix", "codec", "options"),
    [(suffix, *CODECS.get(suffix, ("libx264", {}))) for suffix in VIDEOS]
    + [(".avi", "mpeg4", {}), (".mts", "mpeg2video", {}), (".mp4", "libx264", OPEN), (".mkv", "libx264", OPEN)],
)
def test_each_picture_of_any_container_is_that_of_all_in_turn(tmp_path, suffix, codec, options):
    if codec not in av.codecs_available:
        pytest.skip(f"this PyAV does not write {codec}")
    # Three key pictures, so that there is a jump to one before the last.
    assert_read_as_all_are(encoded(tmp_path / f"a{suffix}", codec, options, 18, 6), 18)


def test_pictures_before_a_cut_are_not_counted(tmp_path):
    """A video cut without encoding keeps pictures before its first, for decoding, at times below 0."""
    with av.open(str(encoded(tmp_path / "whole.mp4"))) as whole, av.open(str(tmp_path / "cut.mp4"), "w") as cut:
        stream = cut.add_stream_from_template(whole.streams.video[0])
        for packet in whole.demux(whole.streams.video[0]):
            if packet.size:
                packet.pts, packet.dts, packet.stream = packet.pts - 6 * 512, packet.dts - 6 * 512, stream
                cut.mux(packet)
    assert_read_as_all_are(tmp_path / "cut.mp4", 22)
    first = read_video_frame(tmp_path / "cut.mp4", 1).pixels
    assert np.array_equal(first, read_video_frame(tmp_path / "whole.mp4", 7).pixels)


def noisy(path, codec, form, count, **options):
    """A video of noise, of which each picture takes about as many bytes."""
    rng = np.random.default_rng(1)
    with av.open(str(path), "w", options=options) as container:
        stream = container.add_stream(codec, rate=24)
        stream.width, stream.height, stream.pix_fmt = 128, 64, form
        for _ in range(count):
            picture = av.VideoFrame.from_ndarray(rng.integers(0, 255, (64, 128, 3), np.uint8), format="rgb24")
            container.mux(stream.encode(picture.reformat(format=form)))
        container.mux(stream.encode())
    return path


def cut(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


@pytest.mark.parametrize(
    ("name", "codec", "form", "options", "line"),
    [
        ("a.avi", "ffv1", "bgr0", {}, "ends early: 2 of 6 frames"),
        ("a.mkv", "ffv1", "bgr0", {}, "ends early: 2 of 6 frames"),
        ("a.webm", "libvpx", "yuv420p", {}, "ends early: [12] of 6 frames"),
        ("a.mp4", "mjpeg", "yuvj420p", {"movflags": "+faststart"}, "ends early: [12] of 6 frames"),
    ],
)
def test_a_video_whose_end_is_missing_is_told(tmp_path, name, codec, form, options, line):
    whole = noisy(tmp_path / name, codec, form, 6, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len([*video_frames(whole)]) == read_video(whole).frames == 6
    short = cut(whole, 0.7 if codec == "libvpx" else 0.42)
    with pytest.warns(UserWarning, match=f"{name} {line}; copy it again"):
        read_video(short)
    if codec != "mjpeg":
        with pytest.warns(UserWarning, match=f"{name} {line}; copy it again") as caught:
            assert len([*video_frames(short)]) in (1, 2)
        assert doubt_of(caught[0].message).wrong


@pytest.mark.parametrize("name", ["a.avi", "a.mp4"])
def test_a_picture_of_which_a_part_is_missing_is_named(tmp_path, name):
    short = cut(noisy(tmp_path / name, "mjpeg", "yuvj420p", 6, movflags="+faststart"), 0.4)
    frames = video_frames(short)
    with pytest.raises(UnreadableFile, match=rf"{name}: frame [23] is damaged in the file; copy it again"):
        list(frames)


def test_a_video_that_begins_late_is_whole(tmp_path):
    path = noisy(tmp_path / "a.mp4", "libx264", "yuv420p", 20)
    with av.open(str(path)) as source, av.open(str(tmp_path / "later.mkv"), "w") as container:
        stream = container.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.pts, packet.dts, packet.stream = packet.pts + 24576, packet.dts + 24576, stream
                container.mux(packet)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len([*video_frames(tmp_path / "later.mkv")]) == read_video(tmp_path / "later.mkv").frames == 20


def test_a_picture_is_decoded_for_the_size_alone(tmp_path, monkeypatch):
    path = encoded(tmp_path / "a.mp4")
    monkeypatch.setattr(
        "relume.image.files.video.reading.read_video_frame", lambda *_: pytest.fail("a picture was decoded")
    )
    assert (read_video(path).frames, read_video(path).rate) == (28, 25)


@pytest.mark.parametrize(
    ("form", "colours", "bits"),
    [("yuv444p", (2, 1), 8), ("yuv444p", (1, 5), 8), ("yuv444p10le", (1, 5), 16), ("yuv444p10le", (2, 1), 16)],
)
def test_colours_go_by_the_range_and_the_matrix_that_a_video_names(tmp_path, form, colours, bits):
    path, (span, matrix) = tmp_path / "a.mkv", colours
    colour = np.array([250, 3, 128])
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=24)
        stream.width, stream.height, stream.pix_fmt = 64, 48, form
        stream.codec_context.color_range, stream.codec_context.colorspace = span, matrix
        frame = np.broadcast_to((colour * 257).astype(np.uint16), (48, 64, 3))
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb48le")
        picture = picture.reformat(format=form, dst_colorspace=matrix, dst_color_range=span)
        picture.color_range, picture.colorspace = span, matrix
        container.mux(stream.encode(picture))
        container.mux(stream.encode())
    read = read_video_frame(path, 1).pixels
    assert read.dtype.itemsize * 8 == bits
    assert np.abs(read[9, 9] / (1 if bits == 8 else 257) - colour).max() < (4 if bits == 8 else 1)


def test_what_is_no_video_is_refused_in_one_line(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"nothing of the kind")
    for path, words in (("a.mp4", "cannot be read as a video"), ("b.mp4", "cannot be opened: No such file")):
        with pytest.raises(UnreadableFile, match=words) as caught:
            read_video(tmp_path / path)
        assert "\n" not in str(caught.value)
