from .ball.blending import Probe as Probe
from .ball.unwrapping import BallView as BallView
from .painting import HotSpot as HotSpot
from .painting import paint as paint
from .panorama.views import PanoramaView as PanoramaView
