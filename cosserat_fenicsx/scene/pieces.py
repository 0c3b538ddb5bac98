"""Properties of a rod that are given in pieces (s_end, value) from its start to its end."""

from cosserat_fenicsx.checks import number, refuse


def checked_pieces(where, field, given, length, what):
    """[(s_end, value)] of pieces whose ends ascend to the rod's length, which the last may write None.

    Args:
        where, field: the rod and its property, in messages; given: the pieces; length: m; what: a value in messages.

    Raises:
        SceneError: a piece that is no pair, or ends that do not ascend to the length.
    """
    pieces, before = [], 0.0
    for i, piece in enumerate(given):
        if not isinstance(piece, list | tuple) or len(piece) != 2:
            refuse(where, f"{field}[{i}]", piece, f"a piece (s_end, {what})")
        end, value = piece
        last = i == len(given) - 1
        if last and end is not None:
            number(where, f"{field}[{i}].to", end, f"the rod's length {length:.12g} m, or None for it",
                   lambda end: abs(end - length) <= 1e-9 * length)  # fmt: skip
        if last:
            end = length
        least = before + 1e-9 * length
        end = number(where, f"{field}[{i}].to", end, f"an arc length above {before:g} and up to {length:g} m",
                     lambda end, least=least: least < end <= length)  # fmt: skip
        pieces.append((end, value))
        before = end
    return pieces
