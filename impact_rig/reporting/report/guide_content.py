"""How to read the report, for people who were not there."""

from impact_rig.reporting.report.document import Facts, Section

ENTRIES = (
    (
        "±",
        (
            "The half-width of the interval that holds the true value with a probability of 95 %"
            " (expanded uncertainty U, GUM). u is a standard uncertainty. A value is rounded to"
            " the second digit of its uncertainty."
        ),
    ),
    (
        "Contact time τp",
        (
            "Twice the width of the mean hammer pulse at half its amplitude, w50: right for a"
            " versed-sine pulse. Hits are laid over each other at the middle of the pulse and"
            " averaged."
        ),
    ),
    (
        "Stiffness k",
        (
            "k_eq = m_eq (π/τp)², with m_eq = m1 m2/(m1 + m2) and m2 the sample with its"
            " accelerometer. k1 = 2 k_eq of the control sample, which is alike to the hammer; then"
            " 1/k2 = 1/k_eq - 1/k1."
        ),
    ),
    (
        "Damping c",
        (
            "From the logarithmic decrement Δ = ln(U1/U2) of two successive peaks:"
            " ζ = Δ/√(4π² + Δ²) and c = 2ζ√(km). U1 lies inside the contact, where the response is"
            " still forced: the free decay after the contact is given beside it."
        ),
    ),
    (
        "Model",
        (
            "Two bodies, each with a spring and a damper, pressed together by a versed-sine force."
            " “driven”: the force alone drives the sample. “printed”: equations (1) and (2) as"
            " they stand in the paper. “identified”: the variant that fits both traces best."
        ),
    ),
    (
        "Paper, reference",
        (
            "The published value of the same sample, or the value that the rig's set-up expects."
            " The difference is measured minus expected, in percent of the expected."
        ),
    ),
    (
        "Hits left out",
        (
            "A hit is judged before it counts: overload, double hit, too weak, truncated, no"
            " pulse, dead channel, gap, outlier among its fellows. A person can overrule that."
        ),
    ),
)


def make_guide_section() -> Section:
    """Explain signs, methods and words."""
    return Section("How to read this", (Facts(ENTRIES),))
