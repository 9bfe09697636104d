"""Parameters of an explanation, and the simulation corrected by it, ready to run.

The posterior of the leading explanation's parameters comes from importance draws, then from chains run to convergence.
The deviations of the sweeps are integrated out: the residuals are linear in them, with the robust weights of the fit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects import CATALOGUE
from damping.forces import list_parameter_names
from damping.forces.powers import Viscous
from damping.gap.fit import ModelFit
from damping.gap.hypotheses import Hypothesis
from damping.gap.simulation import NO_SCATTER, within_tolerance
from damping.infer.chains import Chains, Settings, Target, run
from damping.infer.importance import importance
from damping.infer.likelihood import by_blocks, log_prior
from damping.progress import Progress, silent, unknown_length
from damping.records.mode import Mode

ALIKE = 1.0  #: in ln evidence, a factor of three: targets of one effect that close are told together
_DRAWS = 400  #: number of draws behind each interval
CONTENT = 0.9  #: content of every interval of a diagnosis
#: Most densities of one row for chains: about ten seconds of processor time. Ordinary explanations need a twentieth.
_WORK = 6e7
_FAR = 2.5  #: a best fit is at the end of its range beyond this distance from the prior mean, in standard deviations
_FULL = 0.9  #: a strength beyond this share of its largest value is at the end of its range too
#: Effects whose shape tends, at its upper end, to another of their forms: a compression of large power is a hard clip.
_CLIPS = {"sensor-saturation"}
#: A simulated damping force below this share of itself counts as absent: its tolerance is of this order at best.
_GONE = 0.05
#: Target of an effect of one sweep or state other than readings and force, by the parameter that identifies it.
_ACTS_ON = {"frequency": "frequency", "lag": "phases"}


def refitted_values(fit: ModelFit) -> dict[str, float]:
    """Relative corrections of the simulation's parameters at a fit, by name, without those that an effect replaces."""
    return {name: float(values[0]) for name, values in _refit(fit, fit.y[np.newaxis]).items()}


def _refit(fit: ModelFit, x: FloatArray) -> dict[str, FloatArray]:
    """`refitted_values` at variables x (points, variables), each (points,); effects replace none of a simulator's.

    What is held (``NO_SCATTER``) is 0, not the rounding of a number near 1.
    """
    simulation = fit.model.problem.simulation
    own = () if simulation.simulator is None else simulation.simulator.values.keys()
    replaced = ({part.form.replaces for part in fit.model.parts} - {*own}) | {*simulation.swept}
    free = np.where(simulation.tolerance > NO_SCATTER, simulation.tolerance, 0.0)
    relative = np.expm1(within_tolerance(x[:, : len(simulation.names)]) * free) + 0.0  # no -0
    return {name: relative[:, i] for i, name in enumerate(simulation.names) if name not in replaced}


def effect_values(fit: ModelFit) -> dict[str, dict[str, float]]:
    """Parameters of every effect of a fit, as a model file holds them."""
    parameters = {}
    for part, x in fit.model.own_variables(fit.y[np.newaxis]):
        values = [float(value[0, 0]) for value in part.values(x)]
        parameters[part.form.effect] = {name: float(value) for name, value in part.form.report(*values).items()}
    return parameters


def describe_effects(fit: ModelFit) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Parameters of every effect; for effects of some sweeps or a state also their target, as ``force of sweep B``."""
    sweeps, values, places = fit.model.problem.rows.sweeps, effect_values(fit), dict[str, str]()
    for effect, table in values.items():
        onward, sweep = int(table.pop("onward", 0.0)), int(table.pop("sweep", 0.0))
        if number := int(table.get("state", onward or sweep)):
            forced = table.pop("force", 0.0) > 0.0
            default = "force" if forced else "readings"
            target = next((word for name, word in _ACTS_ON.items() if name in table), default)
            where = f"of state {number}" if "state" in table else f"of sweep {sweeps[number - 1]}"
            places[effect] = f"{target} {where}" if not onward else f"{target} from sweep {sweeps[number - 1]} on"
    return values, places


def name_places(leading: Hypothesis) -> dict[str, str]:
    """Target of every effect that has one; those that fit alike (`ALIKE`) are joined by "or".

    A linear mode, for one, does not tell a reading from the force.
    """
    named = {effect: [place] for effect, place in describe_effects(leading.best)[1].items()}
    least = max(fit.log_evidence for fit in leading.near) - ALIKE
    for fit in leading.near if named else ():
        for effect, place in describe_effects(fit)[1].items():
            if fit.log_evidence > least and place not in named[effect]:
                named[effect].append(place)
    return {effect: " or ".join(places) for effect, places in named.items()}


def effect_intervals(fit: ModelFit) -> dict[str, dict[str, tuple[float, float]]]:
    """Intervals, of content `CONTENT`, of the parameters of every effect of a fit and of its ``simulation``.

    The posterior is taken to be Gaussian. Parameters that are not free (the number of a sweep) have no interval.
    """
    draws = np.random.default_rng(0).multivariate_normal(fit.y, fit.covariance, size=_DRAWS, method="cholesky")
    intervals: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in (*fit.effects, "simulation")}
    tail = 0.5 - 0.5 * CONTENT
    for key, drawn in parameters(fit, draws).items():
        if np.ptp(drawn) > 0.0:
            effect, name = key.split(": ")
            intervals[effect][name] = float(np.quantile(drawn, tail)), float(np.quantile(drawn, 1.0 - tail))
    return intervals


def is_gone(values: Mapping[str, float]) -> bool:
    """Whether an effect with these parameters all but removes the simulated force that it corrects."""
    return values.get("relative", 0.0) < _GONE - 1.0


def list_ends(fit: ModelFit) -> list[str]:
    """Effects of a fit whose best values lie at the end of their prior range, in words."""
    ends = []
    for part, x in fit.model.own_variables(fit.y[np.newaxis]):
        strength, shapes = float(part.values(x)[0][0, 0]), x[0, 1:]
        distance = np.maximum(-shapes, 0.0 if part.form.effect in _CLIPS else shapes)
        if strength > _FULL * part.form.largest or np.any(distance > _FAR):
            ends.append(f"{part.form.effect} fits best at the end of its range: its values are limits, not estimates")
    return ends


@np.errstate(all="ignore")  # a value at the end of its range may overflow when a law is converted
def corrected_mode(fit: ModelFit) -> Mode:
    """The simulation with its refitted parameters and the effects of a fit.

    Damping forces go to ``damping``: coefficients of forces of one name add, and a force that cancels is removed.
    Corrected parameters replace the nominal ones. Everything else goes to ``effects``; beside a simulator, which has
    its own damping and frequency, all effects.
    """
    simulation = fit.model.problem.simulation
    mode = simulation.mode
    if simulation.simulator is not None:
        return replace(mode, effects={**mode.effects, **_beside_simulator(effect_values(fit))})
    relative = refitted_values(fit)
    added: dict[str, Mapping[str, float]] = {}
    others: dict[str, Mapping[str, Any]] = dict(mode.effects)
    for name, values in effect_values(fit).items():
        effect = CATALOGUE[name]
        if effect.corrects and "relative" in values:
            relative[effect.corrects] = values["relative"]
        elif effect.damping and values.keys() - {"relative", "instead"} <= {*list_parameter_names(effect.damping)}:
            added[effect.damping] = {parameter: value for parameter, value in values.items() if parameter != "instead"}
        else:
            others[name] = values
    damping = {name: dict(table) for name, table in mode.damping.items()}
    for name, table in damping.items():
        table[next(iter(table))] *= 1.0 + relative.get(name, 0.0)
    if any("instead" in values for values in effect_values(fit).values()):
        damping.pop(Viscous.name, None)
    for name, law in added.items():
        leading, *rest = (parameter for parameter in law if parameter != "relative")
        total = law[leading] + damping.get(name, {}).get(leading, 0.0)
        damping[name] = {leading: total} | {parameter: law[parameter] for parameter in rest}
        if is_gone(law):
            del damping[name]
    frequency = mode.frequency * (1.0 + relative.get("frequency", 0.0))
    mass = mode.mass * (1.0 + relative.get("mass", 0.0))
    for joints in (damping, others):  # a joint cannot lose more stiffness than the mode has
        if slip := joints.get("slip"):
            joints["slip"] = {**slip, "stiffness": min(slip["stiffness"], mass * (RAD_S_PER_HZ * frequency) ** 2)}
    return replace(mode, frequency=frequency, mass=mass, damping=damping, effects=others)


def _beside_simulator(values: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Tables of effects as a file has them; a law instead of the viscous one is that law, with the viscous one gone."""
    tables = {name: {key: value for key, value in of.items() if key != "instead"} for name, of in values.items()}
    if tables != values:
        tables["viscous-coefficient"] = {"relative": NO_SCATTER - 1.0}
    return tables


@dataclass(frozen=True)
class EffectPosterior:
    """Draws of the explanation's parameters."""

    names: tuple[str, ...]  #: parameters as ``effect: parameter`` (``simulation: parameter``: relative to nominal)
    draws: FloatArray  #: (draws, names)
    #: ``log_evidence``, ``standard_error``: by importance sampling
    log_evidence: float
    standard_error: float
    chains: Chains  #: the run and its convergence

    @property
    def cautions(self) -> tuple[str, ...]:
        """That the chains ended unconverged, if so."""
        rough = "the intervals of the strengths are rough, since their chains ended before they had converged"
        return () if self.chains.converged else (f"{rough} ({self.chains.failure})",)


@np.errstate(all="ignore")  # some draws are impossible models, of density zero
def sample_effects(leading: ModelFit, seed: int, progress: Progress = silent) -> EffectPosterior:
    """Sample the parameters of an explanation, or of the simulation where no effect is blamed."""
    density = partial(log_density, leading)
    variables = leading.model.size
    start = importance(density, leading.y[:variables], leading.covariance[:variables, :variables], seed)
    target = Target(density, variables, partial(parameters, leading))
    settings = Settings().within(_WORK, len(leading.model.problem.rows))
    with unknown_length(progress, "posterior", settings.first) as done:
        chains = run(target, start, seed, settings, done)
    values = parameters(leading, chains.x.reshape(-1, variables))
    table = np.column_stack(list(values.values()))
    return EffectPosterior(tuple(values), table, start.log_z, start.standard_error, chains)


def log_density(leading: ModelFit, x: FloatArray) -> FloatArray:
    """ln of likelihood times N(x; 0, 1), deviations of sweeps integrated out, (points,); x (points, variables)."""
    return by_blocks(lambda points: _log_density(leading, x[points]), len(x), len(leading.weights))


def parameters(leading: ModelFit, x: FloatArray) -> dict[str, FloatArray]:
    """Parameters at variables x (points, variables), each (points,)."""
    drawn = {f"simulation: {name}": values for name, values in _refit(leading, x).items()}
    for part, variables in leading.model.own_variables(x):
        reported = part.form.report(*(value[:, 0] for value in part.values(variables)))
        drawn |= {f"{part.form.effect}: {name}": np.asarray(v) for name, v in reported.items() if np.ndim(v) == 1}
    return drawn


def _log_density(leading: ModelFit, x: FloatArray) -> FloatArray:
    model, W = leading.model, leading.weights
    z = np.tile(leading.y[model.size :], (len(x), 1))
    residuals = model.residuals(np.hstack([x, z]))
    sweep = model.problem.rows.sweep_of_values
    one_hot = (sweep[:, np.newaxis] == np.arange(model.sweeps)).astype(float)
    by_gain, by_frequency = residuals.by_sweep()
    gain, frequency = by_gain * model.scatter.amplitude, by_frequency * model.scatter.frequency
    t = residuals.r - gain * z[:, : model.sweeps][:, sweep] - frequency * z[:, model.sweeps :][:, sweep]
    # per sweep: the 2 x 2 matrix 1 + C^T W C and the vector C^T W t
    gg, ff = 1.0 + (W * gain**2) @ one_hot, 1.0 + (W * frequency**2) @ one_hot
    gf, gt, ft = (W * gain * frequency) @ one_hot, (W * gain * t) @ one_hot, (W * frequency * t) @ one_hot
    det = gg * ff - gf**2
    fitted = (ff * gt**2 - 2.0 * gf * gt * ft + gg * ft**2) / det
    value = -0.5 * (t**2 @ W) + 0.5 * np.sum(fitted - np.log(det), axis=1) + log_prior(x)
    return np.where(np.isfinite(value), value, -np.inf)
