"""A stored result for other programs: JUnit XML of its checks, and a table for LaTeX."""

import re
from xml.etree import ElementTree

from validate.report.numbers import significant
from validate.report.plain import Json

_FAILS = ("differs", "cannot decide")
_EVIDENCE = ("agrees", *_FAILS)
_TEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
}  # fmt: skip
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


def junit(content: Json) -> str:
    """A test suite for each method: its checks, then, as a suite of their own, printed figures.

    What is no evidence (fitted, repeats itself) is skipped with its reason; an experiment that
    compared nothing has one failing case that says so.
    """
    root = ElementTree.Element("testsuites", name=str(content["experiment"]))
    for method in content["methods"]:
        cases = [_check(content, method, c) for c in method["checks"]]
        if cases:
            _suite(root, f"{content['experiment']}.{method['name']}", cases)
    figures = [_figure(p) for p in content["published"]]
    if figures:
        _suite(root, f"{content['experiment']}.published", figures)
    if not len(root):
        empty = ElementTree.Element("testcase", name="checks", classname="nothing compared")
        ElementTree.SubElement(empty, "failure", message="0 checks: nothing was compared")
        _suite(root, str(content["experiment"]), [empty])
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _suite(root: ElementTree.Element, name: str, cases: list[ElementTree.Element]) -> None:
    told = {"name": name, "tests": str(len(cases))}
    for key, tag in (("failures", "failure"), ("skipped", "skipped")):
        told[key] = str(sum(case.find(tag) is not None for case in cases))
    ElementTree.SubElement(root, "testsuite", told).extend(cases)


def _check(content: Json, method: Json, check: Json) -> ElementTree.Element:
    name = f"{content['experiment']}.{method['name']}"
    case = ElementTree.Element("testcase", name=check["name"], classname=name)
    verdict = check["verdict"]
    said = _clean(f"{verdict}: E {_value(check, 'value')}, u_val {_value(check, 'u_val')}, "
                  f"{check['count']} values; {check['why']}")  # fmt: skip
    if verdict not in _EVIDENCE:
        ElementTree.SubElement(case, "skipped", message=said)
    elif verdict in _FAILS and method["accepted"]:
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


def latex(content: Json) -> str:
    """Checks of all methods as a `tabular` (no package is needed): SI values, units in a column."""
    rows = [
        (*_escaped((m["label"], c["name"])), _number(c["value"]), _number(c["u_val"]),
         *_escaped((c["unit"], str(c["count"]), c["verdict"])))
        for m in content["methods"] for c in m["checks"]
    ]  # fmt: skip
    head = ("method", "check", "$E$", r"$u_\mathrm{val}$", "unit", "values", "verdict")
    body = [" & ".join(row) for row in rows]
    lines = [
        f"% {content['experiment']}, {content['created']}: {' '.join(content['sentence'].split())}",
        r"\begin{tabular}{llrrlrl}", r"\hline", " & ".join(head) + r" \\", r"\hline",
        *(line + r" \\" for line in body), r"\hline", r"\end{tabular}", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _number(value: float | None) -> str:
    if value is None:
        return "--"
    digits, _, power = f"{value:.3g}".partition("e")
    return f"${digits}\\times10^{{{int(power)}}}$" if power else f"${digits}$"


def _escaped(row: tuple[str, ...]) -> tuple[str, ...]:
    return tuple("".join(_TEX.get(c, c) for c in cell) for cell in row)
