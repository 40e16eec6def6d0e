from .json_lights import read_lights as read_lights
from .light_files import LightFiles as LightFiles
from .light_files import write_lights as write_lights
from .shot_files import SHOT_FORMATS as SHOT_FORMATS
from .shot_files import ShotFormat as ShotFormat
from .shot_files import export_shot as export_shot
