"""The documentation of several versions side by side."""

import re
import sys
from pathlib import Path

import pytest

MACHINERY = Path(__file__).resolve().parents[2] / "docs" / "machinery"
sys.path.insert(0, str(MACHINERY))
try:
    import links
    import versions
finally:
    sys.path.pop(0)

PAGE = '<html><head><meta content="{}" name="version" /></head><body><div class="sidebar-tree">{}</div></body></html>'


def built(folder, version, word=""):
    (folder / "how-to").mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_text(PAGE.format(version, f'<a href="how-to/a.html">{word}</a>'))
    (folder / "how-to" / "a.html").write_text(PAGE.format(version, '<a href="../index.html">up</a>'))
    return folder


def test_versions_stand_side_by_side_the_newest_first_and_every_page_leads_to_the_list(tmp_path):
    site = tmp_path / "site"
    for version in ("0.2.0", "0.10.0", "0.9.1", "0.10.0rc1"):
        assert versions.add(built(tmp_path / version, version), site) == version
    listed = re.findall(r'href="([^"/]+)/index.html"', (site / "index.html").read_text())
    assert listed == ["0.10.0", "0.10.0rc1", "0.9.1", "0.2.0"]
    assert links.faults(site) == []
    for page in site.glob("*/**/*.html"):
        assert "all versions" in page.read_text()


def test_a_version_is_replaced_and_no_other(tmp_path):
    site = tmp_path / "site"
    versions.add(built(tmp_path / "a", "1.0", "old"), site)
    versions.add(built(tmp_path / "b", "1.1", "other"), site)
    other = (site / "1.1" / "index.html").read_bytes()
    versions.add(built(tmp_path / "a", "1.0", "new"), site)
    assert "new" in (site / "1.0" / "index.html").read_text() and "old" not in (site / "1.0" / "index.html").read_text()
    assert (site / "1.1" / "index.html").read_bytes() == other


def test_a_site_that_does_not_say_its_version_is_refused(tmp_path):
    (tmp_path / "index.html").write_text("<html></html>")
    with pytest.raises(ValueError, match="does not say which version"):
        versions.add(tmp_path, tmp_path / "site")
