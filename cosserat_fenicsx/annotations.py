"""Types that the annotations of the public interface share."""

from collections.abc import Callable, Sequence
from os import PathLike

import numpy as np

#: Numbers, as a list, a tuple or an array.
Numbers = Sequence[float] | np.ndarray
#: Rows of numbers.
Rows = Sequence[Numbers] | np.ndarray
#: Three numbers, or a function of the time (s) that returns them.
NumbersInTime = Numbers | Callable[[float], Numbers]
#: The path of a file.
File = str | PathLike[str]
