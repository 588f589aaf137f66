from .spindle import difference_receptance as difference_receptance
from .spindle import error_gain as error_gain
from .spindle import spindle_flange as spindle_flange
