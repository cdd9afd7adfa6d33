"""Exact order-independent transparency, with the per-pixel fragment lists behind the image."""

from . import _core, scenes, testing
from .blend import BLENDS, Blend
from .camera import Camera
from .comparing import Comparison, compare
from .errors import (
    AbufferError,
    CapacityError,
    DeviceError,
    ParameterError,
    SceneError,
    ShaderError,
    UnsupportedError,
)
from .fragments import Fragments
from .frame import Frame
from .inspecting import inspect
from .mesh import Mesh
from .method import Parameter as MethodParameter
from .own_methods import register_method
from .render import render, render_triangles
from .renderer import Renderer
from .scene import Scene
from .tables import devices, methods, pipelines

__all__ = [
    "BLENDS",
    "AbufferError",
    "Blend",
    "Camera",
    "CapacityError",
    "Comparison",
    "DeviceError",
    "Fragments",
    "Frame",
    "Mesh",
    "MethodParameter",
    "ParameterError",
    "Renderer",
    "Scene",
    "SceneError",
    "ShaderError",
    "UnsupportedError",
    "compare",
    "devices",
    "inspect",
    "methods",
    "pipelines",
    "register_method",
    "render",
    "render_triangles",
    "scenes",
    "testing",
]
__version__ = _core.VERSION
