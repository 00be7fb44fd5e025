"""The report for people: one HTML page, made of reports for programs and of the specification."""

from splatbus_conformance.reports.files.html.page import html_report

__all__ = ["html_report"]
