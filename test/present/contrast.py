"""Contrast of colours as WCAG 2.2 defines it."""


def compute_luminance(colour):
    """Return the relative luminance of red, green and blue, 0 to 255."""
    channels = [value / 255 for value in colour]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def compute_contrast(one, other):
    """Return the contrast ratio of two colours."""
    low, high = sorted((compute_luminance(one), compute_luminance(other)))
    return (high + 0.05) / (low + 0.05)
