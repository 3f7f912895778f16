"""Results and health as Markdown."""

from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MEGA, MICRO, format_uncertain
from impact_rig.visualization.health import Health, Level
from impact_rig.visualization.text import escape_markdown


def write_results(results: Results) -> str:
    """Return everything found as Markdown."""
    lines = ["| Sample | τp [µs] | k₂ [MN/m] | c₂ [N s/m] |", "|:--|--:|--:|--:|"]
    lines += [
        "| "
        + " | ".join(
            (
                escape_markdown(sample.name),
                format_uncertain(
                    sample.contact_time_s * MICRO, sample.contact_time_expanded_s * MICRO, 2
                ),
                format_uncertain(
                    sample.stiffness_n_per_m * MEGA, sample.stiffness_expanded_n_per_m * MEGA, 2
                ),
                format_uncertain(
                    sample.damping_coefficient_n_s_per_m,
                    sample.damping_coefficient_expanded_n_s_per_m,
                    0,
                ),
            )
        )
        + " |"
        for sample in results.samples
    ]
    return "\n".join(lines)


def write_health(health: Health) -> str:
    """Return the state of the nodes as Markdown."""
    paragraphs = []
    for node in health.nodes:
        level = Level(node.level).name if node.level in set(Level) else Level.ERROR.name
        paragraphs.append(f"## {escape_markdown(node.name)}: {level.lower()}")
        paragraphs.append(escape_markdown(node.message))
        paragraphs += [
            f"- {escape_markdown(name)}: {escape_markdown(value)}" for name, value in node.values
        ]
    return "\n\n".join(paragraphs)
