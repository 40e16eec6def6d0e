from . import film as film
from . import lens as lens
from . import tone as tone
