"""The path of a scene with stages: the paths of all stages on one mesh, as one."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.records import Record, Records
from cosserat_fenicsx.results.recovery import Threads
from cosserat_fenicsx.results.result import by_name
from cosserat_fenicsx.scene.rod import Station

# Columns of `Records` that depend on the supports and loads of a stage.
_OF_STAGE = ("reactions", "tie_forces", "clamp_loads", "densities")
# The models by their generality.
_MODELS = ("determinate", "planar", "spatial")


_QUANTITIES = by_name(Quantity("through_stages", "stage + share of its loads", getter="along_axis"))


class StagedPath(Path):
    """A `Path` whose points belong to stages, `stage` (n,) their indices; -1 for the scene's own loads.

    Attributes:
        parts: {stage: its whole `Path`}, each with the scene of that stage; place: (n,) indices into these.
    """

    axis, counted = "stage", "load factor"
    _quantities, _over = _QUANTITIES, "through_stages"

    def __init__(self, scene, parts: Mapping[int, Path]):
        first, *_ = found = list(parts.values())
        general = max(found, key=lambda part: _MODELS.index(part.model))
        labels = {leg.stage: leg.label for leg in scene.legs}

        def told(name):
            of = {}
            for stage, part in parts.items():
                for sentence in getattr(part, name):
                    of.setdefault(sentence, []).append(labels[stage])
            return [x if len(at) == len(found) else f"{', '.join(at)}: {x}" for x, at in of.items()]

        super().__init__(
            scene, first.layout, first.scales, first.rule, comm=first.comm, model=general.model,
            formulation=general.formulation, degree=first.degree, unknowns=max(part.unknowns for part in found),
            why=told("why"), connections=None, expand=None,
        )  # fmt: skip
        self.parts, self.galerkin, self.cautions = dict(parts), general.galerkin, told("cautions")
        self.bounded, self.criteria = first.bounded, first.criteria
        self.rounding = max(part.rounding for part in found)
        self.control = "arc" if any(part.control == "arc" for part in found) else "load"
        self.left = any(part.left for part in found)
        sizes = [len(part) for part in found]
        self._stage = np.repeat(list(parts), sizes)
        self.place = np.concatenate([np.arange(size) for size in sizes])
        columns = [part._all.columns | dict.fromkeys(_OF_STAGE) for part in found if len(part)]
        if columns:
            self._expanded = Records.joined([Records(Record, x) for x in columns])
        self.events = [
            dataclasses.replace(event, stage=stage, after=event.after + sum(sizes[:k]))
            for k, (stage, part) in enumerate(parts.items())
            for event in part.events
        ]

    @property
    def stage(self):
        return self._stage

    @property
    def along_axis(self):
        """(n,) the stage and the share of its last load factor that is reached: 1.5 is halfway through stage 1."""
        ends = {leg.stage: leg.last or 1.0 for leg in self.scene.legs}
        return self._stage + self.load_factors / np.array([ends[stage] for stage in self._stage.tolist()])

    def label(self, k):
        leg = self._legs[self._stage[k]]
        ended = self.load_factors[k] == (leg.last or 1.0)
        return leg.label if ended else f"{leg.label}: {super().label(k)}"

    def stage_label(self, stage):
        """See `Path`."""
        return self._legs[stage].label

    def share_of(self, load, k):
        return self._legs[self._stage[k]].share_of(load, self.load_factors[k])

    def supports_at(self, k):
        return tuple(x.item for x in self._legs[self._stage[k]].supports)

    @property
    def _legs(self):
        return {leg.stage: leg for leg in self.scene.legs}

    def part(self, stage):
        """The points of a stage, a `Path` with the scene of that stage; None where there is none."""
        places = self.place[self._stage == stage]
        if not len(places):
            return None
        whole = self.parts[stage]
        return whole if len(places) == len(whole) else whole.at_points(places)

    def at_points(self, which):
        found = super().at_points(which)
        which = np.asarray(which, dtype=int)
        found._stage, found.place = self._stage[which], self.place[which]
        return found

    def with_places(self, stage, place):
        """The points by their stage and their index within it, (n,) each."""
        first = {k: np.flatnonzero(self._stage == k)[0] for k in np.unique(stage)}
        return self.at_points([first[k] + i for k, i in zip(stage.tolist(), place.tolist(), strict=True)])

    def with_points(self, others, which):
        """See `Path`; both hold the points of each stage in order."""
        stage = np.empty(len(which), dtype=int)
        stage[which], stage[~which] = others.stage, self.stage
        parts = {}
        for k in np.unique(stage).tolist():
            mine, theirs = self.part(k), others.part(k)
            parts[k] = mine.with_points(theirs, which[stage == k]) if mine and theirs else mine or theirs
        return StagedPath(self.scene, parts)

    def _by_stages(self, of_part):
        """An array over the points from the same function of the paths of the stages."""
        found = None
        for k in self.parts:
            here = self._stage == k
            if here.any():
                values = of_part(k, self.parts[k].at_points(self.place[here]))
                found = np.zeros((len(self), *values.shape[1:])) if found is None else found
                found[here] = values
        return found

    @cached_property
    def _contact(self):
        return self._by_stages(lambda _, part: part._contact)

    def _stacked(self, name):
        if name != "densities":
            return super()._stacked(name)
        return tuple(self._by_stages(lambda _, part, i=i: part._stacked(name)[i]) for i in range(2))

    def _without_stress(self, which, rod, s):
        return self.at_points(which)._by_stages(lambda _, part: part._without_stress(range(len(part)), rod, s))

    def _tension(self, tendon):
        """See `RodResult.tendon`; the scene may be another with the same tendons, as one that was read."""
        load = min((load for load in self.scene.all_loads if load == tendon), key=lambda load: load is not tendon)

        def in_part(stage, part):
            named = (*self._legs[stage].standing, *self._legs[stage].ramped)  # loads of the stage's scene, in order
            found = [x for x, given in zip(part.scene.loads, named, strict=False) if given.item is load]
            return sum((Threads(part).tension(x) for x in found), np.zeros(len(part)))

        return self._by_stages(in_part)

    @property
    def conservative(self):
        return all(part.conservative for part in self.parts.values())

    def reaction(self, support):
        """See `Result.reaction`: of a support of the scene or of a stage, zero where it does not hold; one that is
        released still exerts what is left of its reaction then."""
        wanted = None
        if not isinstance(support, str | Station):
            wanted = set(self.scene.places_of(support))
        station = self.scene.station(support) if isinstance(support, str) else support
        if wanted == set() or (wanted is None and all(x.station != station for x in self.scene.all_supports)):
            self.scene.supports_of(support)  # refuses it
        legs, order = self._legs, list(self._legs)

        def exerted(stage, part):
            total = np.zeros((len(part), 6))
            for i, held in enumerate(legs[stage].supports):
                if held.place in wanted if wanted else held.item.station == station:
                    total += np.hstack(part.reaction(part.scene.supports[i]))
            before = order[order.index(stage) - 1] if legs[stage].released else None
            for i in legs[stage].released:
                held, end = legs[before].supports[i], self.parts[before]
                if held.place in wanted if wanted else held.item.station == station:
                    last = end.at_points([len(end) - 1])
                    force = np.hstack(last.reaction(last.scene.supports[i]))
                    total += (1 - part.load_factors)[:, None] * force
            return total

        found = self._by_stages(exerted)
        return tuple(np.split(found if found is not None else np.zeros((0, 6)), 2, axis=1))
