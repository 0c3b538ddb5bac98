"""What a path keeps of a converged state."""

from cosserat_fenicsx.results.records import Record


def record_of(problem, load_factor, negative_modes, iterations, steps, neutral=False):
    """The `Record` of a problem's state, an equilibrium; see there for what is given."""
    model = problem.model
    return Record(load_factor, *model.snapshot(), negative_modes, iterations, problem.multipliers(), neutral,
                  model.densities.here(), problem.tie_forces(), model.clamps.loads(load_factor), steps)  # fmt: skip
