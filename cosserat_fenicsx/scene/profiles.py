"""How the section of a rod changes along it: not at all, in pieces, or by a function of the arc length."""

from collections import namedtuple
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse, store
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.materials import Material
from cosserat_fenicsx.scene.sections import SECTIONS, Stiffness

#: K (..., 3) = (GA1, GA2, EA), N; J (..., 3) = (EI1, EI2, GJ), N m^2; mass (...) = rho A, kg/m, and inertia (..., 3) =
#: (Jrho_1, Jrho_2, Jrho_3), kg m, or None where unknown.
Stiffnesses = namedtuple("Stiffnesses", "K J mass inertia")

_SAMPLES = 33
_NUMBERS = 10  # of a section
_UNKNOWN = [np.nan] * _NUMBERS  # what a function gives


@dataclass(frozen=True, eq=False)
class Profile:
    """The sections of a rod, by its arc length.

    Args:
        owner: the rod, for the words of refusals and for its `length`.
        given: a section; a function from arc length (m) to a section; or a list of pieces (s_end, section or function)
            whose last ends at the rod's length, which may be written None.
        material: as for the rod.

    Attributes:
        pieces: tuple of (s_end, section or function), ascending, the last s_end the rod's length.
        start: the `Stiffness` at s = 0.
        range: the least and the largest of every stiffness along the rod, two `Stiffnesses` with K (3,), J (3,), mass ();
            those of a function are the least and largest of samples.

    Raises:
        SceneError: pieces that do not ascend to the rod's length, or what is no section, at samples along the rod.
    """

    owner: object = field(repr=False)
    given: object
    material: Material | None
    pieces: tuple = field(init=False)
    start: Stiffness = field(init=False)
    range: tuple = field(init=False)

    def __post_init__(self):
        given = self.given if isinstance(self.given, list | tuple) else [(None, self.given)]
        store(self, pieces=self._check_pieces(given))
        store(self, start=self._stiffness(self._piece(0.0, 0)))
        fixed = [_UNKNOWN if _is_law(section) else _row(self._stiffness(section)) for _, section in self.pieces]
        store(self, _fixed=np.array(fixed), _law=[row is _UNKNOWN for row in fixed])
        rows = [self._fixed[[not law for law in self._law]]]
        before = 0.0
        for i, (end, _) in enumerate(self.pieces):
            if self._law[i]:
                s = before + (end - before) * (1 - np.cos(np.linspace(0, np.pi, _SAMPLES))) / 2
                rows.append(self._rows(s, np.full(_SAMPLES, i)))
            before = end
        rows = np.concatenate(rows)
        store(self, range=(_split(rows.min(axis=0)), _split(rows.max(axis=0))))

    def _check_pieces(self, given):
        L, where = self.owner.length, f"Rod '{self.owner.name}'"
        pieces, before = [], 0.0
        if not given:
            refuse(where, "section", given, "at least one piece (s_end, section)")
        for i, piece in enumerate(given):
            if not isinstance(piece, list | tuple) or len(piece) != 2:
                refuse(where, f"section[{i}]", piece, "a piece (s_end, section)")
            end, section = piece
            last = i == len(given) - 1
            if last and end is not None:
                number(where, f"section[{i}].to", end, f"the rod's length {L:.12g} m, or None for it",
                       lambda end: abs(end - L) <= 1e-9 * L)  # fmt: skip
            if last:
                end = L
            least = before + 1e-9 * L
            end = number(where, f"section[{i}].to", end, f"an arc length above {before:g} and up to {L:g} m",
                         lambda end, least=least: least < end <= L)  # fmt: skip
            if not _is_law(section):
                field = "section" if len(given) == 1 else f"section[{i}]"
                instance("Rod", field, section, SECTIONS, "a section such as Circle(diameter), or a function of s")
            pieces.append((end, section))
            before = end
        return tuple(pieces)

    @property
    def breaks(self):
        """Arc lengths inside the rod where the section may jump, m."""
        return tuple(end for end, _ in self.pieces[:-1])

    @property
    def uniform(self):
        """Whether the section is the same everywhere between the `breaks`."""
        return not any(self._law)

    @property
    def constant(self):
        """Whether the section is the same everywhere."""
        return len(self.pieces) == 1 and not self._law[0]

    def section(self, s, side):
        """The section at one arc length."""
        s = float(s)
        return self._piece(s, int(self._index(np.array(s), side)))

    def stiffness(self, s, side):
        """`Stiffnesses` at arc lengths s (...)."""
        s = np.asarray(s, dtype=float)
        if self.constant:
            return _split(np.broadcast_to(self._fixed[0], (*s.shape, _NUMBERS)))
        return _split(self._rows(s.ravel(), self._index(s, side).ravel()).reshape(*s.shape, _NUMBERS))

    def _index(self, s, side):
        if side not in ("left", "right"):
            refuse(f"Rod '{self.owner.name}'", "side", side, "'left' or 'right'")
        within = 1e-9 * self.owner.length * (1 if side == "left" else -1)  # on a jump, but for rounding
        return np.searchsorted(np.add(self.breaks, within), s, side=side)

    def _rows(self, s, index):
        rows = self._fixed[index]
        for k in np.flatnonzero(np.array(self._law)[index]):
            rows[k] = _row(self._stiffness(self._piece(float(s[k]), index[k])))
        return rows

    def _piece(self, s, index):
        """The section at s by one of the pieces."""
        section = self.pieces[index][1]
        if not _is_law(section):
            return section
        where = f"Rod '{self.owner.name}'"
        try:
            made = section(s)
        except SceneError as problem:
            raise SceneError(f"{where}, section at s = {s:g} m: {problem}") from None
        return instance(where, f"section({s:g})", made, SECTIONS, "a section such as Circle(diameter)")

    def _stiffness(self, section):
        if self.material is None and not isinstance(section, Stiffness):
            refuse("Rod", "material", None, f"a Material, which a {type(section).__name__} section needs")
        return section.stiffness(self.material)


def _is_law(section):
    return callable(section) and not isinstance(section, type)


def _row(k):
    mass, inertia = (np.nan if k.mass is None else k.mass), (k.inertia or [np.nan] * 3)
    return [*k.shear, k.axial, *k.bending, k.torsion, mass, *inertia]


def _split(rows):
    mass, inertia = (None if np.isnan(x).any() else x for x in (rows[..., 6], rows[..., 7:]))
    return Stiffnesses(rows[..., :3], rows[..., 3:6], mass, inertia)
