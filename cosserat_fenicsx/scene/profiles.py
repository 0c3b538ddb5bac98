"""Sections and mass centre along a rod: constant, in pieces, or a function of the arc length."""

from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, instance, number, refuse, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import jump_of
from cosserat_fenicsx.parts import Kind, Object, Several, misplaced, spoken
from cosserat_fenicsx.scene.sections import Section, Stiffness, inverse, representative
from cosserat_fenicsx.scene.signals import vector_at
from cosserat_fenicsx.scene.stresses import Stress


def checked_pieces(where, field, given, length, what):
    """[(s_end, value)] of pieces whose ends ascend to the rod's length, m, which the last may write None; else a
    SceneError of `where`, the rod, and `field`, its property; what: a value in messages."""
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


# Tolerance for s at a break, and a distance from it at which s surely belongs to one side, over a rod's length.
_AT_BREAK, BESIDE_BREAK = 1e-9, 4e-9


def piece_at(breaks, s, side, length):
    """Indices of the pieces of a rod that end at `breaks`, at arc lengths s (...), m; `side` as for `stiffness_at`."""
    within = _AT_BREAK * length * (1 if side == "left" else -1)
    return np.searchsorted(np.add(breaks, within), s, side=side)


@dataclass(frozen=True)
class InPieces(Kind):
    """A value of another kind, or pieces (s_end, value) along a rod. key: the key of the value in the table of a piece,
    beside "to"; "" where the value is itself the table."""

    inner: Kind = Kind()
    key: str = ""

    def read(self, where, data, reading):
        if not isinstance(data, list):
            return self.inner.read(where, data, reading)
        if not any(isinstance(piece, dict) for piece in data):
            return data  # two numbers; anything else is refused by the constructor
        pieces = []
        for i, piece in enumerate(data):
            place = (*where, i)
            if not isinstance(piece, dict):
                raise misplaced(place, f"{spoken(place)} = {piece!r}: expected a table")
            if "to" not in piece and i < len(data) - 1:
                raise misplaced(place, f"{spoken(place)}: 'to' is missing: expected where this piece ends (m)")
            rest = {name: value for name, value in piece.items() if name != "to"}
            if self.key and rest.keys() != {self.key}:
                other = next((name for name in rest if name != self.key), None)
                words = f"unknown key '{other}', did you mean '{self.key}'?" if other else f"'{self.key}' is missing"
                raise misplaced((*place, other) if other else place, f"{spoken(place)}: {words}")
            pieces.append((piece.get("to"), self.inner.read(place, rest[self.key] if self.key else rest, reading)))
        return pieces

    def write(self, value, writing):
        if not _has_pieces(value):
            return self.inner.write(value, writing)
        pieces = []
        for end, part in value:
            written = self.inner.write(part, writing)
            pieces.append(({} if end is None else {"to": end}) | ({self.key: written} if self.key else written))
        return pieces

    def schema(self, definitions):
        item = {"properties": {self.key: self.inner.schema(definitions)}} if self.key else {}
        return {"anyOf": [self.inner.schema(definitions), {"type": "array", "items": {"type": "object", **item}}]}


#: What `Rod.eccentricity` may be.
OffsetOfLength = Callable[[float], Numbers]
Offset = Annotated[
    Numbers | OffsetOfLength | Sequence[tuple[float | None, Numbers | OffsetOfLength]],
    InPieces(Several("diameter", 2), "offset"),
]

_EXPECTED = (
    "(a1, a2) along d_1 and d_2 (m), a function from arc length to it, or pieces (s_end, (a1, a2) or function), the "
    "last to the rod's length"
)
_OFFSETS = 33


class MassCentre:
    """The offset of the mass centre of the sections of a rod from its axis, along d_1 and d_2.

    Args:
        owner: the rod: its name for error messages, and its `length`.
        given: as `Rod.eccentricity`, not None.

    Attributes:
        given: the same in a normal form: (a1, a2), a function, or a tuple of pieces.
        breaks: arc lengths inside the rod where it may jump, m.
        largest: the largest distance from the axis, m (of a function: of samples).

    Raises:
        SceneError: none of these, offsets that are not two finite numbers, or ends that do not ascend to the length.
    """

    def __init__(self, owner, given):
        self._where, self._length = f"Rod '{owner.name}'", owner.length
        pieces = self._pieces(given)
        self._ends, self._offsets = zip(*pieces, strict=True)
        self.given = pieces if _has_pieces(given) else pieces[0][1]
        self.breaks = self._ends[:-1]
        s = np.linspace(0, owner.length, _OFFSETS)
        sampled = np.concatenate([self.at(s, side) for side in ("left", "right")])
        self.largest = float(np.linalg.norm(sampled, axis=1).max())

    def at(self, s, side="right"):
        """(..., 3) offsets along d_1, d_2, d_3 at arc lengths s (...), m; `side` as for `Rod.stiffness_at`."""
        s = np.asarray(s, dtype=float)
        index = piece_at(self.breaks, s, side, self._length)
        offsets = np.zeros((*s.shape, 3))
        for k, offset in enumerate(self._offsets):
            here = index == k
            if callable(offset):
                values = [vector_at(self._where, "eccentricity", offset, float(x), "m", 2) for x in s[here]]
                offsets[here, :2] = np.reshape(values, (-1, 2))
            else:
                offsets[here, :2] = offset
        return offsets

    def _pieces(self, given):
        if not _has_pieces(given):
            return ((self._length, self._checked(given, "eccentricity")),)
        pieces = checked_pieces(self._where, "eccentricity", given, self._length, "(a1, a2)")
        return tuple((end, self._checked(x, f"eccentricity[{i}]")) for i, (end, x) in enumerate(pieces))

    def _checked(self, offset, field):
        if callable(offset):
            return offset
        if not isinstance(offset, list | tuple | np.ndarray):
            refuse(self._where, field, offset, _EXPECTED)
        return vector(self._where, field, offset, "m", size=2)


def mass_centre_of(rod):
    """The `MassCentre` of a rod, or None where it is on the axis everywhere."""
    if rod.eccentricity is None:
        return None
    found = MassCentre(rod, rod.eccentricity)
    return found if found.largest or any(map(callable, found._offsets)) else None


def _has_pieces(given):
    """Whether it is a list of pieces rather than one offset."""
    return isinstance(given, list | tuple) and bool(given) and all(isinstance(x, list | tuple) for x in given)


class Stiffnesses(namedtuple("Stiffnesses", "K J mass inertia matrix", defaults=(None,))):
    """Stiffnesses at places along a rod (...).

    Attributes:
        K: (..., 3) = (GA1, GA2, EA), N.
        J: (..., 3) = (EI1, EI2, GJ), N m^2.
        mass: (...) = rho A, kg/m; or None where unknown.
        inertia: (..., 3) = (Jrho_1, Jrho_2, Jrho_3), kg m; or None where unknown.
        matrix: (..., 6, 6), see `Stiffness`, where a section of the rod couples strains, else None. With a matrix, K
            and J are representative stiffnesses, see `sections.representative`.
    """

    __slots__ = ()

    @property
    def flexibility(self):
        """(..., 2, 2) flexibility of bending about d_1 and d_2, without other forces and moments, 1/(N m^2)."""
        if self.matrix is None:
            return np.eye(2) / self.J[..., None, :2]
        return inverse(self.matrix)[..., 3:5, 3:5]

    def contact(self, e, k):
        """n and m (..., 3) of strains e and k, all material; without the forces of infinite stiffnesses."""
        if self.matrix is None:
            return np.where(np.isinf(self.K), 0.0, self.K) * e, self.J * k
        both = np.einsum("...ij,...j->...i", self.matrix, np.concatenate([e, k], axis=-1))
        return both[..., :3], both[..., 3:]

    def strains(self, n, m):
        """The strains v - v_R and u - u_R, (..., 3) each, for contact forces n and moments m (..., 3), all material."""
        if self.matrix is None:
            return n / self.K, m / self.J
        both = np.einsum("...ij,...j->...i", inverse(self.matrix), np.concatenate([n, m], axis=-1))
        return both[..., :3], both[..., 3:]


SectionOfLength = Callable[[float], Section]
#: What `Rod.section` may be.
SectionsAlong = Annotated[
    Section | SectionOfLength | Sequence[tuple[float | None, Section | SectionOfLength]], InPieces(Object((Section,)))
]

_SAMPLES = 33
_DIAGONAL = 10  # numbers (GA1, GA2, EA, EI1, EI2, GJ, mass, inertia) of a section; the 36 of its matrix follow
_NUMBERS = _DIAGONAL + 36
_PRINCIPAL = slice(0, 6)  # stiffnesses among them, of a matrix those about its principal axes
_UNKNOWN = [np.nan] * _NUMBERS  # the row of a piece given by a function


class Sections:
    """The sections of a rod as a function of its arc length.

    Args:
        owner: the rod: its name for error messages, and its `length`.
        given: a section; a function from arc length (m) to a section; or a list of pieces (s_end, section or function)
            whose last ends at the rod's length, which may be written None.
        material: as for the rod.

    Attributes:
        pieces: tuple of (s_end, section or function), ascending, the last s_end the rod's length.
        start: the `Stiffness` at s = 0.
        range: the least and the largest of every stiffness along the rod, two `Stiffnesses` with K (3,), J (3,), mass
            () and no matrix; of a function, those of samples.
        coupled: whether a section couples strains (of a function: at samples).

    Raises:
        SceneError: pieces that do not ascend to the rod's length, or a function that returns no section at a sample.
    """

    def __init__(self, owner, given, material):
        self.owner, self.material = owner, material
        self.pieces = self._check_pieces(given)
        self.start = self._stiffness(self._piece(0.0, 0))
        self._law = [_is_law(section) for _, section in self.pieces]
        if self.constant:
            self._fixed, self.coupled, self.range = _of_constant(self.start)
        else:
            fixed = [_UNKNOWN if law else _row(self._stiffness(section))
                     for law, (_, section) in zip(self._law, self.pieces, strict=True)]  # fmt: skip
            self._fixed = np.array(fixed)
            self.coupled, self.range = _bounds(self._sampled())
        if self.coupled and np.isinf(self.range[1].K).any():
            expected = "finite stiffnesses along a rod that has a section with a matrix"
            refuse(f"Rod '{owner.name}'", "section", given, expected)

    def _sampled(self):
        """The rows of pieces, of functions those of samples."""
        rows, before = [self._fixed[[not law for law in self._law]]], 0.0
        for i, (end, _) in enumerate(self.pieces):
            if self._law[i]:
                s = before + (end - before) * (1 - np.cos(np.linspace(0, np.pi, _SAMPLES))) / 2
                rows.append(self._rows(s, np.full(_SAMPLES, i)))
                self._refuse_jump(i, before, end)
            before = end
        return np.concatenate(rows)

    def _refuse_jump(self, i, low, high):
        def numbers(s):
            rows = self._rows(s, np.full(len(s), i))
            has_matrix = np.nan_to_num(rows[:, _DIAGONAL:]).any()
            rows[:, _PRINCIPAL if has_matrix else slice(_DIAGONAL, None)] = 0.0  # principal axes may change places
            return rows

        if (s := jump_of(numbers, low, high)) is not None:
            raise SceneError(
                f"Rod '{self.owner.name}': its section jumps at s = {s:.6g} m: expected pieces (s_end, section or "
                "function), at whose ends elements end"
            )

    def _check_pieces(self, given):
        where, pieces = f"Rod '{self.owner.name}'", [(self.owner.length, given)]
        if isinstance(given, list | tuple):
            if not given:
                refuse(where, "section", given, "at least one piece (s_end, section)")
            pieces = checked_pieces(where, "section", given, self.owner.length, "section")
        for i, (_, section) in enumerate(pieces):
            if not _is_law(section):
                field = "section" if len(pieces) == 1 else f"section[{i}]"
                instance("Rod", field, section, Section, "a section such as Circle(diameter), or a function of s")
        return tuple(pieces)

    @property
    def breaks(self):
        """Arc lengths inside the rod where the section may jump, m."""
        return tuple(end for end, _ in self.pieces[:-1])

    @cached_property
    def uniform(self):
        """Whether the section is constant between the `breaks`."""
        return not any(self._law)

    @property
    def constant(self):
        """Whether the section is constant along the whole rod."""
        return len(self.pieces) == 1 and not self._law[0]

    @cached_property
    def alike(self):
        """A key that is equal for equal constant sections; for others the object itself."""
        return self._fixed.tobytes() if self.constant else self

    def section(self, s, side):
        """The section at an arc length, m; `side` as for `Rod.stiffness_at`."""
        s = float(s)
        return self._piece(s, int(self._index(np.array(s), side)))

    def stiffness(self, s, side):
        """`Stiffnesses` at arc lengths s (...), m; `side` as for `Rod.stiffness_at`."""
        s = np.asarray(s, dtype=float)
        if self.constant:
            return _split(np.broadcast_to(self._fixed[0], (*s.shape, _NUMBERS)), self.coupled)
        rows = self._rows(s.ravel(), self._index(s, side).ravel())
        return _split(rows.reshape(*s.shape, _NUMBERS), self.coupled)

    @cached_property
    def shaped(self):
        """Whether a section knows its shape, and so its stresses (of a function: at both ends of its piece)."""
        starts, zero = (0.0, *self.breaks), np.zeros(3)
        sections = [
            self._piece(s, i)
            for i, (end, _) in enumerate(self.pieces)
            for s in ([starts[i], end] if self._law[i] else [end])
        ]
        return any(section.stresses(self.material, zero, zero) is not None for section in sections)

    def stresses(self, s, side, force, moment):
        """`Stress` at arc lengths s (n,), m, NaN where the section does not know its shape.

        Args:
            side: as for `Rod.stiffness_at`; force, moment: (..., n, 3), N and N m, along d_1, d_2, d_3.
        """
        found, index = np.full((3, *force.shape[:-1]), np.nan), self._index(s, side)
        groups = [(int(i), np.flatnonzero(index == i)) for i in np.unique(index)]
        alike = [(i, part) for i, own in groups for part in (own[:, None] if self._law[i] else [own])]
        for i, here in alike:
            own = self._piece(float(s[here[0]]), i).stresses(self.material, force[..., here, :], moment[..., here, :])
            if own is not None:
                found[..., here] = own
        return Stress(*found)

    def _index(self, s, side):
        if side not in ("left", "right"):
            refuse(f"Rod '{self.owner.name}'", "side", side, "'left' or 'right'")
        if len(self.pieces) == 1:
            return np.zeros(np.shape(s), dtype=int)
        return piece_at(self.breaks, s, side, self.owner.length)

    def _rows(self, s, index):
        rows = self._fixed[index]
        for k in np.flatnonzero(np.array(self._law)[index]):
            rows[k] = _row(self._stiffness(self._piece(float(s[k]), index[k])))
        return rows

    def _piece(self, s, index):
        """The section of one of the pieces at s."""
        section = self.pieces[index][1]
        if not _is_law(section):
            return section
        where = f"Rod '{self.owner.name}'"
        try:
            made = section(s)
        except SceneError as problem:
            raise SceneError(f"{where}, section at s = {s:g} m: {problem}") from None
        return instance(where, f"section({s:g})", made, Section, "a section such as Circle(diameter)")

    def _stiffness(self, section):
        if self.material is None and not isinstance(section, Stiffness):
            refuse("Rod", "material", None, f"a Material, which a {type(section).__name__} section needs")
        try:
            return _stiffness_of(section, self.material)
        except TypeError:  # a section of the user's that cannot be hashed
            return section.stiffness(self.material)


@lru_cache(maxsize=16)
def _stiffness_of(section, material):
    """The `Stiffness` of a section, made once for many rods."""
    return section.stiffness(material)


@lru_cache(maxsize=16)
def _of_constant(stiffness):
    """The row of a `Stiffness`, and `_bounds` of it, made once for many rods."""
    fixed = np.array([_row(stiffness)])
    fixed.flags.writeable = False
    return fixed, *_bounds(fixed)


def _bounds(rows):
    """Whether rows have a matrix; and the least and the largest of every stiffness, see `Sections`."""
    both = np.stack([bound(rows[:, :_DIAGONAL], axis=0) for bound in (np.min, np.max)])
    both.flags.writeable = False  # rods share them
    return bool(np.isfinite(rows[:, _DIAGONAL:]).any()), tuple(_split(row, False) for row in both)


def _is_law(section):
    return callable(section) and not isinstance(section, type)


def _row(k):
    mass, inertia = (np.nan if k.mass is None else k.mass), (k.inertia or [np.nan] * 3)
    if k.matrix is None:
        return [*k.shear, k.axial, *k.bending, k.torsion, mass, *inertia, *[np.nan] * 36]
    return [*representative(k.matrix), mass, *inertia, *np.ravel(k.matrix)]


def _split(rows, coupled):
    mass, inertia = (None if np.isnan(x).any() else x for x in (rows[..., 6], rows[..., 7:_DIAGONAL]))
    if not coupled:
        return Stiffnesses(rows[..., :3], rows[..., 3:6], mass, inertia)
    given = rows[..., _DIAGONAL:].reshape(*rows.shape[:-1], 6, 6)
    matrix = np.where(np.isnan(given), np.eye(6) * rows[..., None, :6], given)
    return Stiffnesses(rows[..., :3], rows[..., 3:6], mass, inertia, matrix)
