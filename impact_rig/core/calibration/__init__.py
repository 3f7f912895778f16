"""The sensitivity of a sensor from hits that a second sensor sees as well."""
