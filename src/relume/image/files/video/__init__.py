"""Videos: movies that are written, and frames of anyone's videos."""

from relume.image.files.video.movie import Movie
from relume.image.files.video.reading import (
    VIDEOS,
    Video,
    is_video,
    read_video,
    read_video_frame,
    video_frames,
    video_rate,
)

__all__ = ["VIDEOS", "Movie", "Video", "is_video", "read_video", "read_video_frame", "video_frames", "video_rate"]
