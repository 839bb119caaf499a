"""Hooks of mkdocs: the order of docs/README.md, and pages that stand alone without the repository."""
import pathlib
import re
import urllib.parse

LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)")


def linked_pages(text):
    """Sections of docs/README.md with the pages that they link, each page once, in order."""
    seen, sections = {"README.md"}, []
    for line in text.splitlines():
        if line.startswith("## "):
            sections.append((line[3:].split(":")[0], []))
        for _, target in LINK.findall(line):
            page = target.split("#")[0]
            if sections and page.endswith(".md") and not page.startswith("..") and page not in seen:
                seen.add(page)
                sections[-1][1].append(page)
    return sections


def on_config(config):
    docs = pathlib.Path(config["docs_dir"])
    nav = ["README.md"]
    for name, pages in linked_pages((docs / "README.md").read_text(encoding="utf-8")):
        nav.append({name: pages})
    nav.append({"Decisions": sorted(f"adr/{page.name}" for page in (docs / "adr").glob("*.md"))})
    named = {page for entry in nav[1:] for pages in entry.values() for page in pages}
    nav[-1]["Decisions"] = [page for page in nav[-1]["Decisions"] if page not in
                            {p for entry in nav[1:-1] for pages in entry.values() for p in pages}]
    missing = {page.name for page in docs.glob("*.md")} - named - {"README.md"}
    if missing:
        raise SystemExit(f"docs/README.md does not link {', '.join(sorted(missing))}")
    config["nav"] = nav
    return config


def on_page_markdown(markdown, page, config, files):
    """A link out of docs/ becomes the path in the repository; a diagram stays its text, since the
    theme would fetch the program that draws it."""
    docs = pathlib.Path(config["docs_dir"])
    folder = (docs / page.file.src_uri).parent

    def replaced(match):
        text, target = match.groups()
        if urllib.parse.urlparse(target).scheme or target.startswith("#"):
            return match.group(0)
        path = (folder / target.split("#")[0]).resolve()
        if path.is_dir():  # a folder of pages: its first one
            inside = sorted(path.glob("*.md"))
            return f"[{text}]({target.rstrip('/')}/{inside[0].name})" if inside else f"`{text}`"
        if path.is_relative_to(docs.resolve()):
            return match.group(0)
        name = path.relative_to(docs.resolve().parent).as_posix()
        plain = text.strip("`").removeprefix("../")
        return f"`{name}`" if plain == name else f"{text} (`{name}` in the repository)"

    return LINK.sub(replaced, markdown).replace("```mermaid", "```text")
