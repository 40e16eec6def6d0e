from .darkroom import Darkroom as Darkroom
from .film import Film as Film
from .stocks import black_and_white_negative as black_and_white_negative
from .stocks import colour_negative as colour_negative
from .stocks import colour_paper as colour_paper
from .stocks import paper as paper
from .stocks import slide as slide
