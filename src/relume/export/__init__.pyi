from .shot_files import SHOT_FORMATS as SHOT_FORMATS
from .shot_files import ShotFormat as ShotFormat
from .shot_files import export_shot as export_shot
