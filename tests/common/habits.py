"""Habits that cost a reader time, counted in the product: `python -m tests.common.habits`.

A place is counted by its syntax alone, so that the rule is the same for everybody.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
PRODUCT = ("simbench", "detectors", "scenarios")

Trees = Mapping[str, ast.Module]


def product_trees() -> dict[str, ast.Module]:
    """Return the syntax tree of every file of the product by its path."""
    files = sorted(p for name in PRODUCT for p in (ROOT / name).rglob("*.py"))
    return {p.relative_to(ROOT).as_posix(): ast.parse(p.read_text("utf-8")) for p in files}


def packed(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements that state several facts: names that are unpacked from a tuple written
    out, a generator, a `map` or a conditional. A swap states one.
    """
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple)):
            continue
        names = {ast.unparse(name) for name in node.targets[0].elts}
        match node.value:
            case ast.Tuple(elts=values) if {ast.unparse(x) for x in values} != names:
                yield node
            case ast.GeneratorExp() | ast.ListComp() | ast.IfExp():
                yield node
            case ast.Call(func=ast.Name(id="map")):
                yield node


def mistyped(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the functions that say "Return whether" and return no truth value, and those that
    return an object or, as a bare string, why there is none.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef) or node.returns is None:
            continue
        answer = ast.unparse(node.returns)
        says = (ast.get_docstring(node) or "").startswith(("Return whether", "Whether"))
        if (says and not answer.startswith(("bool", "np.ndarray", "tuple"))) or _or_text(answer):
            yield node


def _or_text(answer: str) -> bool:
    """Return whether an annotation is a class of the product or a string."""
    forms = answer.split(" | ")
    classes = [form for form in forms if form[:1].isupper() and form.isalpha() and form != "None"]
    return "str" in forms and bool(classes)


def edited_as_tables(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the functions in which a loop becomes a table and a table a loop."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            called = {
                call.func.attr
                for call in ast.walk(node)
                if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)
            }
            if {"to_table", "from_table"} <= called:
                yield node


HABITS: dict[str, Callable[[ast.Module], Iterator[ast.stmt]]] = {
    "several facts in one statement": packed,
    "a type hidden in a string": mistyped,
    "a loop edited as a table": edited_as_tables,
}


def places(habit: str, trees: Trees) -> list[str]:
    """Return file and line of every place with a habit."""
    found = HABITS[habit]
    return [f"{name}:{node.lineno}" for name, tree in trees.items() for node in found(tree)]


def statements(trees: Trees) -> int:
    """Return the number of statements."""
    return sum(isinstance(node, ast.stmt) for tree in trees.values() for node in ast.walk(tree))


def main() -> None:
    """Print the counts, and with a word of a habit its places."""
    trees = product_trees()
    total = statements(trees)
    for habit in HABITS:
        found = places(habit, trees)
        print(f"{habit}: {len(found)}, {1000 * len(found) / total:.1f} per 1000 statements")
        if any(word in habit for word in sys.argv[1:]):
            print(*(f"  {place}" for place in found), sep="\n")


if __name__ == "__main__":
    main()
