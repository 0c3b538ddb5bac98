"""How a string moves in one mode: its shape, and where its kinetic energy is."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.drilling.linear.impedances import Disc, Uniform

#: Points of Gauss in a part, beside those for its waves.
_POINTS = 8


@dataclass(frozen=True)
class ModeShape:
    """One mode: real motions are Re(w exp(s t)).

    Attributes:
        root: s, 1/s. depth: (m,) below the top drive, m; the number of the disc for discs. rotation: (m,) complex, the
            amplitude of the rotation om, 1 at the bit. velocity: (m,) complex, the axial one in m/s per rad/s of the
            bit; None where nothing moves axially. shares: {what: share} of the kinetic energy over a period, of the
            components by name, of the top drive and the bit; "axial motion of ..." for the axial part. lengths: {name:
            m} of the components; empty for discs.
    """

    root: complex
    depth: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray | None
    shares: dict[str, float]
    lengths: dict[str, float]

    @property
    def where(self) -> str:
        """Where it moves, in words."""
        return where(self.shares, self.lengths)


def where(shares, lengths):
    """The largest shares of the kinetic energy up to nine tenths; and the part where it is densest, with its length."""
    words, covered = [], 0.0
    for name, share in sorted(shares.items(), key=lambda item: -item[1]):
        words.append(f"{name} {100 * share:.0f} %")
        covered += share
        if covered > 0.9 or len(words) == 3:
            break
    text, whole = ", ".join(words), sum(lengths.values())
    parts = {name: shares.get(name, 0.0) / (length / whole) for name, length in lengths.items()}
    densest = max(parts, key=parts.get, default=None)
    if densest is None or parts[densest] < 2:
        return text
    share, length = 100 * shares[densest], 100 * lengths[densest] / whole
    return f"{text}; densest in the {densest}: {share:.0f} % on {length:.0f} % of the length"


def shape_of(equation, s, points=200):
    """The `ModeShape` of a root of a characteristic function, at about so many points."""
    motions, energies = [], {}
    for guide, amplitude in zip(equation.guides, equation.motion(s), strict=True):
        depth, w, energy = _along(guide, s, points)
        motions.append(amplitude * w)
        for name, value in energy.items():
            name = name if guide.kind == "torsion" else f"axial motion of {name}"
            energies[name] = energies.get(name, 0.0) + abs(amplitude) ** 2 * value
    total = sum(energies.values())
    shares = {name: float(value / total) for name, value in energies.items() if value}
    lengths = {}
    for part in equation.guides[0].parts:
        if isinstance(part, Uniform):
            lengths[part.name] = lengths.get(part.name, 0.0) + part.length
    return ModeShape(complex(s), depth, motions[0], motions[1] if len(motions) > 1 else None, shares, lengths)


def _along(guide, s, points):
    """(depth, w, {name: twice the kinetic energy}) of one guide, w = 1 at the bit."""
    at = np.array([s], dtype=complex)
    state, size = guide.start(at), 1.0
    depth, w, energy, top = [], [], {}, 0.0
    if guide.top_inertia and state.w[0] != 0:
        energy["top drive"] = guide.top_inertia * abs(state.w[0]) ** 2
    for k, part in enumerate(guide.parts):
        if isinstance(part, Disc):
            depth.append(np.array([k + 1.0]))
            w.append(size * state.w)
            energy[part.name] = part.inertia * abs(size * state.w[0]) ** 2
            below = part.through(at, state)
        else:
            n = _POINTS + 2 * int(abs(s) * part.travel)
            share = max(2, round(points * part.travel / guide.travel))
            nodes, weights = np.polynomial.legendre.leggauss(n)
            x = np.concatenate([part.length * (1 + nodes) / 2, np.linspace(0.0, part.length, share)])
            here = size * part.through(at, state, x).w * np.exp(part.decay(at, x))
            twice = part.inertia * part.length / 2 * float(weights @ np.abs(here[:n]) ** 2)
            energy[part.name] = energy.get(part.name, 0.0) + twice
            depth.append(top + x[n:])
            w.append(here[n:])
            top += part.length
            below = part.through(at, state, part.length).times(np.exp(part.decay(at, part.length)))
        scaled = below.scaled(part.impedance)
        size *= (abs(below.w) + abs(below.P))[0] / (abs(scaled.w) + abs(scaled.P))[0]
        state = scaled
    if guide.inertia:
        energy["bit"] = guide.inertia * abs(size * state.w[0]) ** 2
    bit = w[-1][-1]
    return np.concatenate(depth), np.concatenate(w) / bit, {n: e / abs(bit) ** 2 for n, e in energy.items()}
