# SPDX-License-Identifier: MIT
"""The documentation as a site: it can be built, and a link that leads nowhere is refused."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("zensical")


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    """tools/site.py, whose name Python's own `site` has."""
    spec = importlib.util.spec_from_file_location("pelorus_site", ROOT / "tools/site.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def staged(builder: ModuleType, tmp_path: Path) -> Path:
    builder.stage(tmp_path, None)
    return tmp_path


def test_every_page_is_in_the_site_and_in_its_navigation(builder: ModuleType, staged: Path) -> None:
    site = builder.built(staged)
    start = (site / "index.html").read_text()
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "include").rglob("*.h")]
    assert len(pages) > 20
    for page in pages:
        name = page.relative_to(ROOT).as_posix()
        made = "index.html" if name == "README.md" else f"{name.removesuffix('.md')}.html"
        assert (site / made).is_file(), made
        assert f'href="./{made}"' in start or made == "index.html", made
    assert not re.search(r'(?:src|href)="https?://[^"]*\.(?:js|css|woff2?)"', start)


@pytest.mark.parametrize("link", ["docs/NOWHERE.md", "docs/MATH.md#no-such-heading"])
def test_a_link_that_leads_nowhere_is_refused_by_name(
    builder: ModuleType, staged: Path, link: str
) -> None:
    page = staged / "pages/README.md"
    page.write_text(page.read_text() + f"\n[there]({link})\n")
    with pytest.raises(SystemExit, match="does not exist") as refused:
        builder.built(staged)
    assert "README.md" in str(refused.value)
