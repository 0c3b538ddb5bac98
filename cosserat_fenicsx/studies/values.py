"""What a task may return, as data for JSON and back, to the last digit."""

import numbers

import numpy as np

from cosserat_fenicsx.checks import refuse

_EXPECTED = "a number, a text, an array of numbers or of texts, None, or a dict of these by name"


def to_data(result):
    """A task's result as data.

    Raises:
        SceneError: it is none of what a task may return.
    """
    if isinstance(result, dict):
        for name in result:
            if not isinstance(name, str):
                refuse("study", "task", name, "names of results that are texts")
        return {"dict": {name: _of_value(value) for name, value in result.items()}}
    return _of_value(result)


def from_data(data):
    """The result of `to_data`; lists have become arrays."""
    if not isinstance(data, dict):
        return data
    if "dict" in data:
        return {name: from_data(value) for name, value in data["dict"].items()}
    if "number" in data:
        return complex(*data["number"])
    flat = np.array(data["array"], dtype=data["dtype"])
    return (flat.view(complex) if data["complex numbers"] else flat).reshape(data["shape"])


def _of_value(value):
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, complex):
        return {"number": [value.real, value.imag]}
    if isinstance(value, numbers.Real):  # such as a fraction
        return float(value)
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    masked = isinstance(value, np.ma.MaskedArray)  # whose mask would be lost
    if masked or not isinstance(value, np.ndarray | list | tuple) or array.dtype.kind not in "biufcU":
        refuse("study.task", "result", value, _EXPECTED)
    flat, pairs = array.ravel(), array.dtype.kind == "c"
    if pairs:
        flat = flat.astype(complex).view(float)
    elif array.dtype.kind == "f" and array.itemsize > 8:
        flat = flat.astype(float)
    return {"array": flat.tolist(), "dtype": flat.dtype.str, "shape": array.shape, "complex numbers": pairs}
