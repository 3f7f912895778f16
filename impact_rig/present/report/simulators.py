"""Contacts for simulators: a chapter for whoever asks for it."""

from impact_rig.core.errors import ParameterError
from impact_rig.present.figures.simulators_figure import draw_simulators_figure
from impact_rig.present.report.document import Paragraph, Part, Picture, Section
from impact_rig.results.run import Run
from impact_rig.simulators.check import check_engine, find_obstacle
from impact_rig.simulators.contact import MeasuredContacts, make_contacts
from impact_rig.simulators.parameters import ENGINES, compute_parameters
from impact_rig.simulators.tables import tabulate_checks, tabulate_parameters

TITLE = "In simulators"


def make_simulators_section(run: Run) -> Section:
    """Return every sample's parameters for every engine; engines strike the control sample.

    Parameters
    ----------
    run : Run
        What to tell of. Where there is no law of the control sample, the first is struck.
    """
    contacts, reasons = _make_contacts(run)
    if not contacts:
        return Section(TITLE, tuple(Paragraph(f"{reason}.") for reason in reasons))
    tables = [
        tabulate_parameters(
            [compute_parameters(engine, measured) for measured in contacts.values()]
        )
        for engine in ENGINES.values()
    ]
    control = run.campaign.results.setup.samples.control_sample
    name = control if control in contacts else next(iter(contacts))
    return Section(TITLE, (*tables, *_strike(run, name, contacts[name])))


def _make_contacts(run: Run) -> tuple[dict[str, MeasuredContacts], list[str]]:
    """Return the contacts by sample, and why others have none."""
    contacts, reasons = {}, []
    for sample in run.campaign.results.samples:
        try:
            contacts[sample.name] = make_contacts([run.campaign.results], sample.name)
        except ParameterError as error:
            reasons.append(str(error))
    return contacts, reasons


def _strike(run: Run, name: str, measured: MeasuredContacts) -> list[Part]:
    """Return what the engines that are installed make of one contact."""
    engines = [engine for engine in ENGINES.values() if engine.package]
    parts: list[Part] = [
        Paragraph(
            f"{engine.title} is not installed here, and has not struck: pip install"
            f" {engine.package}."
        )
        for engine in engines
        if find_obstacle(engine)
    ]
    checks = [
        check_engine(compute_parameters(engine, measured))
        for engine in engines
        if not find_obstacle(engine)
    ]
    if checks:
        traces = next((item for item in run.campaign.samples if item.name == name), None)
        figure = Picture(draw_simulators_figure(checks, traces))
        parts = [tabulate_checks(checks), figure, *parts]
    return parts
