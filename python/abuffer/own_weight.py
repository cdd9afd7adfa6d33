"""A weight of one's own for weighted blending (McGuire and Bavoil 2013): an expression of WGSL in z and alpha.

GPUs run it as it is. For the CPU and captured lists the same text becomes a function of arrays, as far as it is made of numbers,
operators and the functions below, which mean the same in both.
"""

import ast
import operator
import re
from dataclasses import replace

import numpy as np

from . import _core
from .errors import ParameterError

WGSL = """fn weight_of(z: f32, alpha: f32) -> f32 {{ return ({expression}); }}

struct State {{
    sum: vec4f,
    coverage: Coverage,
}}

fn begin(place: Place) -> State {{
    return State(vec4f(0.0), coverage_none());
}}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {{
    return pass_index == 0u;
}}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {{
    let color = fragment.color;
    // A quotient by 0 and an overflow have no sum: between the limits weights are what they say.
    let weight = color.a * clamp(weight_of(fragment.depth, color.a), 0.0, 1e6);
    (*s).sum += vec4f(weight * color.rgb, weight);
    (*s).coverage = coverage_add((*s).coverage, color.a);
}}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {{
    return layer_over(coverage_of_mean((*s).coverage, (*s).sum), behind);
}}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {{
    return 0u;
}}
"""

MOST = 1e6  # of weights, in both
FUNCTIONS = {
    "abs": np.abs,
    "ceil": np.ceil,
    "clamp": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "cos": np.cos,
    "exp": np.exp,
    "exp2": np.exp2,
    "floor": np.floor,
    "fract": lambda x: x - np.floor(x),
    "log": np.log,
    "log2": np.log2,
    "max": np.maximum,
    "min": np.minimum,
    "mix": lambda x, y, a: x * (1 - a) + y * a,
    "pow": np.power,
    "saturate": lambda x: np.clip(x, 0, 1),
    "select": lambda otherwise, then, condition: np.where(condition, then, otherwise),
    "sin": np.sin,
    "sqrt": np.sqrt,
    "step": lambda edge, x: np.where(x >= edge, 1.0, 0.0),
}
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


def weighted(wboit, expression):
    """The row of weighted blending with a weight of one's own in place of the paper's.

    Args:
        wboit: the row of the table.
        expression: of z, the eye depth, and alpha; it multiplies alpha times colour, and counts as 0 below 0, and as MOST above.

    Raises:
        ShaderError: it is no expression of WGSL. ParameterError: it uses what is not known here.
    """
    if "//" in expression or "/*" in expression:
        raise ParameterError(f"weight {expression!r} has a comment: give the expression alone")
    wgsl = WGSL.format(expression=expression)
    _core.check_method("weight", wgsl, "", False)
    weight = _function(expression)

    def composite(color, depth, primitive, behind):
        alpha = color[..., 3]
        with np.errstate(all="ignore"):
            own = alpha * np.clip(np.nan_to_num(weight(depth, alpha), nan=0.0, posinf=MOST, neginf=0.0), 0, MOST)
        through = np.cumprod(1 - alpha, axis=1)
        before = np.concatenate([np.ones((len(alpha), 1)), through], axis=1)
        coverage = (before[:, :-1] * alpha).sum(axis=1, keepdims=True)
        total = own.sum(axis=1, keepdims=True)
        mean = (own[..., None] * color[..., :3]).sum(axis=1) / np.where(total > 0, total, 1)
        mean = np.where(total > 0, mean, 0)
        back = np.concatenate([behind[:, :3] * behind[:, 3:], behind[:, 3:]], axis=1)
        return np.concatenate([mean * coverage, coverage], axis=1) + before[:, -1:] * back

    return replace(
        wboit,
        wgsl=wgsl,
        numpy=composite,
        parameters=(),
        passes=lambda: 1,
        bytes_per_pixel=lambda: wboit.bytes_per_pixel(weight=expression),
        takes_range=False,
        is_native=False,
    )


def _function(expression):
    """The expression as a function of arrays."""
    text = re.sub(r"(?<=[\d.])f\b", "", expression)  # 1.0f is a number of WGSL
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError:
        raise _unknown(expression, "this") from None
    _check(tree, expression)
    return lambda z, alpha: _value(tree, {"z": z, "alpha": alpha})


def _check(node, expression):
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return
        case ast.Name(id="z" | "alpha"):
            return
        case ast.UnaryOp() if type(node.op) in OPERATORS:
            parts = [node.operand]
        case ast.BinOp() if type(node.op) in OPERATORS:
            parts = [node.left, node.right]
            if isinstance(node.op, ast.Div) and all(_is_integer(part) for part in parts):
                raise ParameterError(
                    f"weight {expression!r} divides integers, whose quotient is one in WGSL: write 1.0 / 2.0"
                )
        case ast.Compare(ops=[op]) if type(op) in OPERATORS:
            parts = [node.left, *node.comparators]
        case ast.Call(func=ast.Name(id=name), keywords=[]) if name in FUNCTIONS:
            parts = node.args
        case _:
            raise _unknown(expression, ast.unparse(node))
    for part in parts:
        _check(part, expression)


def _is_integer(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def _unknown(expression, what):
    return ParameterError(
        f"weight {expression!r} is for the CPU and lists too, which do not know {what!r}: they have z, alpha, numbers, "
        f"+ - * / < <= > >= and {', '.join(FUNCTIONS)}; register_method takes any WGSL, with a numpy of your own"
    )


def _value(node, names):
    match node:
        case ast.Constant():
            return float(node.value)
        case ast.Name():
            return names[node.id]
        case ast.UnaryOp():
            return OPERATORS[type(node.op)](_value(node.operand, names))
        case ast.BinOp():
            return OPERATORS[type(node.op)](_value(node.left, names), _value(node.right, names))
        case ast.Compare():
            return OPERATORS[type(node.ops[0])](_value(node.left, names), _value(node.comparators[0], names))
        case ast.Call():
            return FUNCTIONS[node.func.id](*(_value(argument, names) for argument in node.args))
