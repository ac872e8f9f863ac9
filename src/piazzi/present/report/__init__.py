"""One HTML page that needs nothing else: `page` of tabs of blocks, and the tabs of what Piazzi computes."""

from piazzi.present.report.blocks import Chart, Key, Section, Tab
from piazzi.present.report.comparison import comparison_tab
from piazzi.present.report.observability import observability_section, observability_tab
from piazzi.present.report.page import page
from piazzi.present.report.study import study_tabs
from piazzi.present.report.windows import windows_section, windows_tab
from piazzi.present.report.write import write_page, write_report

__all__ = [
    "Chart", "Key", "Section", "Tab", "comparison_tab", "observability_section", "observability_tab", "page", "study_tabs",
    "windows_section", "windows_tab", "write_page", "write_report",
]  # fmt: skip
