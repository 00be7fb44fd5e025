"""The report for people: one HTML page, made of reports for programs and of the specification."""
