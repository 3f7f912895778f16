"""The closed form of the model, beside an integrator, an exponential, and itself; and a hit."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

from bench.measure import Bench, Figure, at_least, at_most, compare_times, divide, part
from impact_rig.core.estimation.contact_law import MARGINS, look_at_law
from impact_rig.core.estimation.law_fit import fit_law
from impact_rig.core.estimation.pulse_window import PulseWindow, cut_window
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.hit import judge_hit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.model.impact import (
    ImpactModel,
    ModelVariant,
    simulate_impact,
    simulate_impacts,
)
from impact_rig.core.model.sensitivities import compute_sensitivities
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import HAMMER_DAMPING_COEFFICIENT, PAPER_SETUP
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.filtering import FILTER_ORDER
from impact_rig.core.signals.record import Block, FloatArray, HitLabel
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.plants import make_nominal_model
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

METHOD = "DOP853"
LAW_SAMPLE = "steel medium"
LAW_END = 5.0
"""Until which a pulse is integrated [T]: it is over at 3.2, or later with loss."""
LAW_TOLERANCE = 1e-9
"""Of its integration [-], our choice: the derivatives are differences."""
LONGEST_LAW = 5.0
"""Of one hit's contact law [ms], as asked for."""
SMALLEST_LAW_GAIN = 40.0
"""Of its fit over a general one [-], as asked for."""
TOLERANCE = 1e-10
"""Relative, of each state [-]; as asked for."""
SMALLEST = 1e-17
"""The same, absolute [m, m/s], our choice: small enough that `TOLERANCE` alone decides, even where
a state passes through zero."""
SCALES = (1e-6, 1e-6, 1e-2, 1e-2)
"""Of x1, x2, x1' and x2' in the paper's impacts [m, m/s]: who knows them asks for `TOLERANCE` of
these, and has a third fewer steps."""

Motion = Callable[[float | FloatArray, FloatArray], FloatArray]
"""Takes a time [s] and x1, x2, x1', x2', and returns their rates; many moments at once too."""


def integrate_impact(
    model: ImpactModel,
    times: FloatArray,
    variant: ModelVariant,
    absolute: float | Sequence[float] = SMALLEST,
) -> FloatArray:
    """Return the accelerations of both bodies as an integrator finds them.

    In two parts, since an integrator does not see the end of the pulse coming.

    Parameters
    ----------
    model : ImpactModel
        Parameters.
    times : ndarray, shape (n,)
        From the start of the contact, rising, some of them after its end [s].
    variant : ModelVariant
        How the bodies are driven.
    absolute : float or sequence of float
        Absolute tolerance, of each state or of all [m, m/s].

    Returns
    -------
    ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    """
    contact, free = _make_motions(model, variant)
    tau = model.contact_time
    during, after = times[times <= tau], times[times > tau]
    speed = model.impact_speed if variant is ModelVariant.PRINTED else 0.0
    begin = np.array([0.0, 0.0, speed, 0.0])
    states = _step(contact, begin, np.append(during, tau), 0.0, absolute)
    later = _step(free, states[:, -1], after, tau, absolute)
    return np.hstack([contact(during, states[:, :-1])[2:], free(after, later)[2:]])


def _make_motions(model: ImpactModel, variant: ModelVariant) -> tuple[Motion, Motion]:
    """Return the rates of the states during the contact and after it."""
    first, second, tau = model.hammer, model.specimen, model.contact_time
    m1, k1, c1 = first.mass, first.stiffness, first.damping_coefficient
    m2, k2, c2 = second.mass, second.stiffness, second.damping_coefficient
    peak, is_printed = model.peak_force, variant is ModelVariant.PRINTED

    def contact(moment: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        force = peak * np.sin(np.pi * moment / tau) ** 2
        own = c2 * v2 + k2 * x2
        if is_printed:
            between = c1 * (v1 - v2) + k1 * (x1 - x2)
            return np.array([v1, v2, -between / m1, (between - force - own) / m2])
        return np.array([v1, v2, -force / m1, (force - own) / m2])

    def free(_: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        hammer = -(c1 * v1 + k1 * x1) / m1 if is_printed else 0.0 * v1
        return np.array([v1, v2, hammer, -(c2 * v2 + k2 * x2) / m2])

    return contact, free


def _step(
    motion: Motion,
    state: FloatArray,
    times: FloatArray,
    begin: float,
    absolute: float | Sequence[float],
) -> FloatArray:
    solution = solve_ivp(
        motion,
        (begin, times[-1]),
        state,
        method=METHOD,
        t_eval=times,
        rtol=TOLERANCE,
        atol=absolute,
    )
    states: FloatArray = solution.y
    return states


SAMPLE = "steel medium"
SAMPLING_RATE = 2.5e6
"""Of the paper [Hz]."""
COUNT = 5000
"""Points of a record: 2 ms."""
BATCH = 1000
"""Records in one call [-], as asked for."""
SCATTER = 0.1
"""Largest change of each parameter in the batch, relative [-], our choice."""
CALLS = 150
"""Of what takes microseconds, in one turn [-], our choice: as long as one integration."""
LENIENT = tuple(TOLERANCE * scale for scale in SCALES)
"""Absolute tolerances of an integrator that is told how large the states are [m, m/s]."""
SMALLEST_GAIN = 150.0
LARGEST_DIFFERENCE = 1e-9
LARGEST_COST = 3.0
SMALLEST_BATCH_GAIN = 2.0
"""Over the integrator, of the peak, in exponentials and over single calls [-], as asked for."""


@part("model", "The model: one record and many, beside integrator and exponential", 9.0)
def measure_model(bench: Bench) -> Iterator[Figure]:
    """Time one record and many, with both ways to drive the bodies."""
    variants = tuple(ModelVariant)
    for number, variant in enumerate(variants):
        bench.report(number, len(variants))
        yield from _measure_one(bench.extent.repeats, variant)
        yield _measure_many(bench.extent.repeats, variant, bench.extent.seed)


def _measure_one(repeats: int, variant: ModelVariant) -> Iterator[Figure]:
    """Compare one record with the integrator, an exponential and its own sensitivities."""
    model = make_nominal_model(PAPER_SETUP, SAMPLE, HAMMER_DAMPING_COEFFICIENT)
    times = np.arange(COUNT) / SAMPLING_RATE
    exponents = (-1e3 + 1e5j) * times
    name, asked = variant.value, f"{METHOD} at rtol {TOLERANCE:g}"

    def simulate() -> object:
        return simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant)

    def compare(peer: Callable[[], object], calls: int = 1) -> tuple[list[float], list[float]]:
        return compare_times(simulate, peer, repeats, (CALLS, calls))

    ours, theirs = compare(lambda: integrate_impact(model, times, variant))
    note = f"{1e6 * min(ours):.0f} us at best, {asked} {1e3 * min(theirs):.1f} ms"
    speed = f"{name}, speed over that of {METHOD}"
    yield Figure(speed, divide(theirs, ours), "", at_least(SMALLEST_GAIN), note)
    ours, theirs = compare(lambda: integrate_impact(model, times, variant, LENIENT))
    note = f"{asked} and atol {TOLERANCE:g} of each state's size"
    yield Figure(f"{name}, the same with atol by state", divide(theirs, ours), note=note)
    difference = f"{name}, difference from it over the peak"
    yield Figure(difference, compute_difference(model, variant), "", at_most(LARGEST_DIFFERENCE))
    ours, theirs = compare(lambda: np.exp(exponents), CALLS)
    note = f"of as many points, {1e6 * min(theirs):.0f} us at best"
    cost = f"{name}, time over that of a complex exp"
    yield Figure(cost, divide(ours, theirs), "", at_most(LARGEST_COST), note)
    ours, theirs = compare(
        lambda: compute_sensitivities(model, SAMPLING_RATE, COUNT, variant=variant), CALLS
    )
    yield Figure(f"{name}, all sensitivities over the traces", divide(theirs, ours))


def compute_difference(model: ImpactModel, variant: ModelVariant) -> float:
    """Return the largest difference from the integrator over the peak of the trace [-]."""
    ours = np.array(simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant))
    theirs = integrate_impact(model, np.arange(COUNT) / SAMPLING_RATE, variant)
    return float(np.max(np.abs(ours - theirs).max(axis=1) / np.abs(theirs).max(axis=1)))


def _measure_many(repeats: int, variant: ModelVariant, seed: int) -> Figure:
    """Compare one call for many records with as many calls."""
    models = make_models(BATCH, seed)

    def simulate_all() -> object:
        return simulate_impacts(models, SAMPLING_RATE, COUNT, variant=variant)

    def simulate_each() -> object:
        return [simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant) for model in models]

    together, single = compare_times(simulate_all, simulate_each, repeats)
    return Figure(
        f"{variant.value}, speed of {BATCH} in a batch over single calls",
        divide(single, together),
        goal=at_least(SMALLEST_BATCH_GAIN),
        note=f"{1e6 * min(together) / BATCH:.0f} us for each at best",
    )


def make_models(count: int, seed: int) -> Sequence[ImpactModel]:
    """Return models of the paper's samples, no two of them alike."""
    generator = np.random.default_rng(seed)
    names = PAPER_SETUP.samples.names
    nominal = [make_nominal_model(PAPER_SETUP, name, HAMMER_DAMPING_COEFFICIENT) for name in names]
    models = []
    for number in range(count):
        model = nominal[number % len(nominal)]
        factors = generator.uniform(1.0 - SCATTER, 1.0 + SCATTER, 3)
        specimen = replace(
            model.specimen,
            stiffness=float(factors[0] * model.specimen.stiffness),
            damping_coefficient=float(factors[1] * model.specimen.damping_coefficient),
        )
        contact_time = float(factors[2] * model.contact_time)
        models.append(replace(model, specimen=specimen, contact_time=contact_time))
    return models


BLOCK_SIZE = 1000
"""Of each channel [points]: as the accelerometer node sends them."""
CUTOFF = PAPER_SETUP.analysis.cutoff_frequency
"""Of the traces and of the low-pass [Hz]: the paper's."""
HITS = 24
"""In one turn [-], our choice: two of each of the paper's samples, tens of milliseconds."""
LARGEST_HIT_COST = 2.0
"""Over that of the low-pass [-], as asked for."""
LONGEST_TIME = 1.0
"""Of one hit [ms], as asked for."""


@part("hit", "A hit from blocks to verdict, beside the low-pass alone", 1.0)
def measure_hit(bench: Bench) -> Iterator[Figure]:
    """Time hits from blocks to verdicts, in the core alone, as all of its users do it."""
    streams = strike_hits(HITS)
    traces = [read_traces(blocks) for blocks in streams]
    sections = design_sections()
    ours, peers = compare_times(
        lambda: count_accepted(streams), lambda: filter_all(traces, sections), bench.extent.repeats
    )
    note = f"scipy.signal.sosfiltfilt of both channels, {1e6 * min(peers) / HITS:.0f} us at best"
    ratios = divide(ours, peers)
    yield Figure("time over that of the low-pass", ratios, "", at_most(LARGEST_HIT_COST), note)
    note = f"{traces[0].shape[1]} points of two channels in blocks of {BLOCK_SIZE}"
    times = (1e3 * time / HITS for time in ours)
    yield Figure("one hit: detect, judge, filter, width", times, "ms", at_most(LONGEST_TIME), note)
    yield from _measure_law(bench.extent.repeats)


def _measure_law(repeats: int) -> Iterator[Figure]:
    """Time the contact law of one hit, and its fit beside a general one around an integrator."""
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant=Plant.CONTACT))
    session = Session(PAPER_SETUP)
    for block in rig.strike(HitLabel(LAW_SAMPLE)).split(BLOCK_SIZE, 0):
        session.feed(block)
    mean = session.compute_mean(LAW_SAMPLE)
    assert mean is not None
    window = cut_law_window(mean)
    laws, _ = compare_times(
        lambda: look_at_law(mean, PAPER_SETUP, LAW_SAMPLE), lambda: fit_law(window), repeats
    )
    times = (1e3 * time for time in laws)
    yield Figure("one hit: its contact law", times, "ms", at_most(LONGEST_LAW))
    general, fits = compare_times(
        lambda: fit_by_integration(window), lambda: fit_law(window), repeats
    )
    note = f"least_squares around {METHOD}, to the same minimum"
    speed = "times faster: fit of the contact law"
    yield Figure(speed, divide(general, fits), "", at_least(SMALLEST_LAW_GAIN), note)


def cut_law_window(mean: MeanHit) -> PulseWindow:
    """Return the pulse that a law is fitted to."""
    return cut_window(
        mean.traces[0],
        measure_pulse(mean.traces[0]),
        mean.sampling_rate,
        PAPER_SETUP.analysis.cutoff_frequency,
        margins=MARGINS,
    )


def fit_by_integration(window: PulseWindow) -> FloatArray:
    """Return start, T, height, offset, alpha v and n by `least_squares` around an integrator."""

    def move(exponent: float, damping: float) -> Callable[[float, FloatArray], list[float]]:
        return lambda _, y: [
            y[1],
            -np.sign(y[0]) * abs(y[0]) ** exponent * (1.0 + damping * y[1]),
        ]

    def compute_residual(parameters: FloatArray) -> FloatArray:
        start, unit, height, offset, damping, exponent = parameters
        scaled = (window.model_time - start) / unit
        solution = solve_ivp(
            move(exponent, damping),
            (0.0, LAW_END),
            [0.0, 1.0],
            method=METHOD,
            rtol=LAW_TOLERANCE,
            atol=LAW_TOLERANCE,
            dense_output=True,
        ).sol(np.clip(scaled, 0.0, LAW_END))
        touching = (solution[0] > 0.0) & (scaled > 0.0) & (scaled < LAW_END)
        force = np.abs(solution[0]) ** exponent * (1.0 + damping * solution[1])
        smoothed = height * np.where(touching, force, 0.0)
        if window.smoothing is not None:
            smoothed = window.smoothing @ smoothed
        residual: FloatArray = smoothed + offset - window.measured
        return residual

    start = [-0.9, 0.55, 1.3, 0.0, 0.1, 1.5]
    found: FloatArray = least_squares(
        compute_residual, start, x_scale="jac", xtol=1e-6, ftol=1e-6
    ).x
    return found


def strike_hits(count: int) -> list[tuple[Block, ...]]:
    """Return the blocks of good hits on the paper's samples."""
    rig, names = VirtualRig(PAPER_SETUP, VirtualRigSettings()), PAPER_SETUP.samples.names
    labels = [
        HitLabel(names[number % len(names)], number + 1, number // len(names) + 1)
        for number in range(count)
    ]
    return [tuple(rig.strike(label).split(BLOCK_SIZE, 0)) for label in labels]


def read_traces(blocks: Sequence[Block]) -> FloatArray:
    """Return what both channels of a hit show, shape (2, n)."""
    return np.array(
        [
            np.concatenate([block.hammer.output for block in blocks]),
            np.concatenate([block.specimen.output for block in blocks]),
        ],
        dtype=np.float64,
    )


def count_accepted(streams: Sequence[Sequence[Block]]) -> int:
    """Find every hit in its blocks and judge it; return how many are accepted."""
    settings = PAPER_SETUP.analysis
    detector, accepted = ImpactDetector(settings), 0
    for blocks in streams:
        for block in blocks:
            for record in detector.feed(block):
                accepted += judge_hit(record, settings).accepted
    return accepted


def design_sections() -> FloatArray:
    """Return the second-order sections of the low-pass."""
    # Two passes of order n have -3 dB where one has -1.5 dB: at (sqrt(2) - 1)^(1 / 2n).
    one_pass = CUTOFF / (np.sqrt(2.0) - 1.0) ** (1.0 / (2 * FILTER_ORDER))
    sections: FloatArray = butter(FILTER_ORDER, one_pass, fs=SAMPLING_RATE, output="sos")
    return sections


def filter_all(traces: Sequence[FloatArray], sections: FloatArray) -> list[FloatArray]:
    """Filter every hit by the library's function alone, with the padding of ours."""
    padding = int(3 * SAMPLING_RATE / CUTOFF)
    return [sosfiltfilt(sections, both, padtype="even", padlen=padding) for both in traces]
