"""The report for people: one HTML page, made of reports for programs and of the specification."""

from splatbus_conformance.page.page import html_report

__all__ = ["html_report"]
