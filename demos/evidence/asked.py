"""Cells of a table that compare a measured number with the largest one that is asked for."""


def share(number):
    """A ratio as text, below one as a fraction: 1/4.3; a dash for None."""
    if number is None:
        return "-"
    return f"1/{1 / number:.3g}" if number < 1 else f"{number:.3g}"


def judged(found, most, form=None):
    """The last three cells of a row: what was found, what is asked at most, and whether it is met.

    Args:
        found: a ratio; or a number of another unit, with the format specification `form`; or None.
    """
    verdict = "-" if found is None else "met" if found <= most else "missed"
    return " | ".join((format(found, form), f"{most:g}", verdict) if form else (share(found), share(most), verdict))


#: The heads of these cells, after that of the first.
HEADS = "asked at most | |"
