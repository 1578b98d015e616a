"""Export of a stored result: JUnit XML of its checks, and tables for LaTeX."""

import re
from dataclasses import replace
from itertools import zip_longest
from xml.etree import ElementTree

from validate.compare.exhibit import Entry, NumberTable, TableCell
from validate.numbers import MISSING, significant
from validate.report.export.tables import sheet, word_columns
from validate.report.stored.json_values import Json

_FAILS = ("not good enough", "undecided", "differs", "no answer", "nothing compared")
_NO_EVIDENCE = ("fitted", "same model")
_COUNTED = {"tests": "", "failures": "failure", "errors": "error", "skipped": "skipped"}
_TEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "²": r"$^2$", "±": r"$\pm$", "−": r"$-$", "µ": r"$\mu$", "–": "--", "\u202f": r"\,",
}  # fmt: skip
_NUMBER = re.compile("(−?[\\d\u202f]+(?:\\.\\d+)?)(?:e(−?\\d+))?")
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


def junit(content: Json) -> str:
    """Return a suite for the verdict over all checks, one a method, one for printed figures.

    It fails where `validate run` does: a requirement that is not met, and, where nothing is
    required, a difference from zero; one that differs by itself but not after Holm's correction
    passes and says so. What is no evidence (fitted, same model) is skipped with its reason; an
    accepted method that did not finish is an error; nothing compared is a failure. A published
    figure that moved is a failure of its own suite only.
    """
    name = _clean(str(content["experiment"]))
    root = ElementTree.Element("testsuites", name=name)
    case = ElementTree.Element("testcase", name="all checks", classname=content["experiment"])
    overall = content["overall"]
    said = _clean(f"{overall['verdict']}, {overall['evidence']} of {overall['checks']} checks are "
                  f"evidence; {' '.join(content['sentence'].split())}")  # fmt: skip
    if content["passed"]:
        ElementTree.SubElement(case, "system-out").text = said
    else:
        ElementTree.SubElement(case, "failure", message=said, type=overall["verdict"])
    suites = [(f"{name}.verdict", [case])]
    suites += [(_clean(f"{name}.{m['name']}"), _cases(content, m)) for m in content["methods"]]
    suites += [
        (f"{name}.published", [_figure(p) for p in content["published"] if p.get("result", True)])
    ]
    for title, cases in suites:
        if cases:
            suite = ElementTree.SubElement(
                root, "testsuite", name=title, timestamp=content["created"]
            )
            counts = {key: sum(case.find(tag) is not None for case in cases)
                      for key, tag in _COUNTED.items() if tag}  # fmt: skip
            suite.attrib.update({k: str(n) for k, n in {"tests": len(cases), **counts}.items()})
            suite.extend(cases)
    for key in _COUNTED:
        root.set(key, str(sum(int(suite.get(key, 0)) for suite in root)))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _cases(content: Json, method: Json) -> list[ElementTree.Element]:
    """The checks of a method, after its end where it did not finish."""
    cases = [_check(content, method, c) for c in method["checks"]]
    outcome = method["outcome"]
    if outcome["state"] != "finished":
        end = _case(content, method, "finished")
        kind = "error" if method["accepted"] else "skipped"
        said = _clean(f"{outcome['state']} at step {outcome['step']}: {outcome['why']}")
        ElementTree.SubElement(end, kind, message=said)
        cases.insert(0, end)
    return cases


def _case(content: Json, method: Json, name: str) -> ElementTree.Element:
    classname = _clean(f"{content['experiment']}.{method['name']}")
    return ElementTree.Element("testcase", name=_clean(name), classname=classname)


def _check(content: Json, method: Json, check: Json) -> ElementTree.Element:
    case = _case(content, method, check["name"])
    verdict, overall = check["verdict"], content["overall"]
    alone = verdict == "differs" and check["name"] not in overall["differs"]
    words = "differs alone, but not after Holm's correction" if alone else verdict
    said = _clean(f"{words} ({check['validation']}): E {_value(check, 'value')}, u_val "
                  f"{_value(check, 'u_val')}, limit {_value(check, 'limit')}, margin "
                  f"{_value(check, 'margin')}, {check['count']} values; {check['why']}; limit: "
                  f"{check['requirement']}")  # fmt: skip
    if verdict in _NO_EVIDENCE:
        ElementTree.SubElement(case, "skipped", message=said)
    elif verdict in _FAILS and method["accepted"] and not alone:
        ElementTree.SubElement(case, "failure", message=said, type=verdict)
    else:
        ElementTree.SubElement(case, "system-out").text = said
    return case


def _figure(figure: Json) -> ElementTree.Element:
    case = ElementTree.Element("testcase", name=_clean(figure["name"]), classname="published")
    said = _clean(f"{figure['verdict']}: ours {figure['ours']}, theirs {figure['theirs']} "
                  f"{figure.get('unit', '')}; {figure['reason']} ({figure['source']})")  # fmt: skip
    if figure.get("fault"):
        ElementTree.SubElement(case, "failure", message=_clean(str(figure["fault"])))
    ElementTree.SubElement(case, "system-out").text = said
    return case


def _value(check: Json, key: str) -> str:
    return "none" if check[key] is None else f"{significant(check[key])} {check['unit']}"


def _clean(text: str) -> str:
    return _UNPRINTABLE.sub("?", text)


def tabular(table: NumberTable, remark: str = "") -> str:
    """Return a table as LaTeX's `tabular` (no package is needed), entries as a page shows them; the
    words that stand below a row there are comments."""
    found = sheet(replace(table, rows=tuple(tuple(map(_unmarked, row)) for row in table.rows)))
    words = word_columns(table)
    columns = "".join("l" if i in words else "r" for i in found.columns)
    said = (f" % {' '.join(words.split())}" if words else "" for words in found.below)
    rows = [f"{' & '.join(map(_entry, row))} \\\\{after}"
            for row, after in zip_longest(found.texts, said, fillvalue="")]  # fmt: skip
    return "\n".join((
        f"% {' '.join((remark or table.title).split())}",
        rf"\begin{{tabular}}{{{columns}}}", r"\hline",
        " & ".join(_escaped(table.headings[i]) for i in found.columns) + r" \\", r"\hline",
        *rows, r"\hline", r"\end{tabular}", "",
    ))  # fmt: skip


def _unmarked(entry: Entry | TableCell) -> Entry | TableCell:
    """Without an emphasis, so without its sign."""
    return replace(entry, emphasis="") if isinstance(entry, TableCell) else entry


def _entry(text: str) -> str:
    """A number in mathematics, so that its sign is one; any other text as it is."""
    found = _NUMBER.fullmatch(text)
    if text == MISSING or not found:
        return "--" if text == MISSING else _escaped(text)
    digits = found[1].replace("\u202f", r"\,").replace("−", "-")
    power = found[2].replace("−", "-") if found[2] else ""
    return f"${digits}" + (rf"\times10^{{{power}}}" if power else "") + "$"


def _escaped(text: str) -> str:
    return "".join(_TEX.get(c, c) for c in text)
