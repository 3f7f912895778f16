"""What is given: set-up, sensors, records, and the form of a result: quantity, finding, error."""
