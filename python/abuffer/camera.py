"""Where the picture is taken from."""

import warnings

import numpy as np

from . import _check
from ._view import check_rigid, clip_depths, looking, turn_y_to
from .errors import ParameterError


class Camera:
    """A view and a projection. Checked once, here; read-only afterwards.

    The world is right-handed. The eye looks along −Z with Y up (OpenGL axes); depth is the distance from the
    eye along that axis, in world units. Matrices multiply columns: ``clip = projection @ view @ position``.
    Pixel [y, x] has its centre at (x + .5, y + .5); row 0 is on top.

    Args:
        view: (4, 4) world to eye: a rotation and a translation, since depth is in world units.
        projection: (4, 4) eye to clip, y up. Its last row is (0, 0, −1, 0), a perspective, or (0, 0, 0, 1).
        clip_z: the clip-space z over w of the near and the far plane: (0, 1), or (-1, 1) for OpenGL.

    Raises:
        ParameterError: a matrix of another kind (transposed, scaled, looking along +Z, oblique), or degenerate.

    >>> camera = Camera.look_at((0, 0, 3), (0, 0, 0))
    >>> xy, depth = camera.project([[0, 0, 1]], 200, 100)
    >>> xy.tolist(), depth.tolist()
    ([[100.0, 50.0]], [2.0])
    """

    def __init__(self, view, projection, *, clip_z=(0, 1)):
        projection = _check.matrix("projection", projection)
        view = _check.affine("view", view)
        check_rigid("view", view)
        last = projection[3]
        if tuple(last) not in ((0, 0, -1, 0), (0, 0, 0, 1)):
            forwards = last[2] > 0 and not last[[0, 1, 3]].any()
            hint = "it looks along +Z: use Camera.from_intrinsics" if forwards else "transposed?"
            raise ParameterError(
                f"projection's last row must be (0, 0, -1, 0) or (0, 0, 0, 1), got {last.tolist()}: {hint}"
            )
        if (projection[2, :2] != 0).any():
            raise ParameterError("projection has an oblique near plane: its third row must be (0, 0, a, b)")
        x, y = projection[0, :3], projection[1, :3]
        if not (np.abs(x[:2]).any() and np.abs(y[:2]).any()) or abs(x[0] * y[1] - x[1] * y[0]) == 0:
            raise ParameterError("projection maps all points to one line of the image")
        perspective = bool(projection[3, 2] != 0)
        near, far = clip_depths(projection[2], clip_z, perspective)
        aspect = float(np.linalg.norm(y[:2]) / np.linalg.norm(x[:2]))
        self._set(view, projection[:2], perspective, near, far, aspect)

    @classmethod
    def look_at(cls, eye, target, up=(0, 1, 0), *, fov_y=45.0, near=None, far=None):
        """A perspective from `eye` towards `target`, for an image of any size.

        Args:
            eye, target, up: (3,) world units; up need not be perpendicular.
            fov_y: full vertical field of view, degrees.
            near, far: eye depths outside which nothing is drawn. None: nothing in front of the eye is cut.
        """
        return cls._perspective_of(looking(eye, target, up), _fov(fov_y), near, far)

    @classmethod
    def orthographic(cls, eye, target, up=(0, 1, 0), *, height, near=None, far=None):
        """A parallel projection. `height`: world units from the image's bottom to its top."""
        height = _check.number("height", height, 0, open_ends=True)
        xy = np.array([[2 / height, 0, 0, 0], [0, 2 / height, 0, 0]])
        return cls._made(looking(eye, target, up), xy, False, *_cuts(False, near, far))

    @classmethod
    def from_pose(cls, camera_to_world, *, fov_y=45.0, near=None, far=None):
        """A perspective from a (4, 4) pose in OpenGL axes: its columns are right, up, backwards, position.

        The first three have length 1.
        """
        pose = _check.affine("camera_to_world", camera_to_world)
        check_rigid("camera_to_world", pose, is_pose=True)
        return cls._perspective_of(np.linalg.inv(pose), _fov(fov_y), near, far)

    @classmethod
    def from_intrinsics(cls, K, world_to_camera, *, width, height, pixel_center=0.0, near=None, far=None):
        """A pinhole camera in OpenCV axes (x right, y down, z forward).

        Args:
            K: (3, 3) intrinsics in pixels of an image of `width` × `height`.
            world_to_camera: (3, 4) or (4, 4) extrinsics: a rotation and a translation.
            pixel_center: the coordinate of the first pixel's centre in K's convention: 0 for OpenCV,
                0.5 for COLMAP and PyTorch3D.
        """
        k = _check.matrix("K", K, ((3, 3),))
        if k[1, 0] != 0 or tuple(k[2]) != (0, 0, 1) or k[0, 0] <= 0 or k[1, 1] <= 0:
            raise ParameterError(f"K must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0, got {k.tolist()}")
        width, height = _size("width", width), _size("height", height)
        extrinsics = np.eye(4)
        given = _check.matrix("world_to_camera", world_to_camera, ((3, 4), (4, 4)))
        extrinsics[: len(given)] = given
        shift = 0.5 - _check.number("pixel_center", pixel_center)
        extrinsics = _check.affine("world_to_camera", extrinsics)
        check_rigid("world_to_camera", extrinsics)
        # x = fx X/Z + s Y/Z + cx with Y = −y_eye, Z = −z_eye, then to NDC; the last row makes w = −z_eye.
        cx, cy = k[0, 2] + shift, k[1, 2] + shift
        xy = np.array(
            [
                [2 * k[0, 0] / width, -2 * k[0, 1] / width, 1 - 2 * cx / width, 0],
                [0, 2 * k[1, 1] / height, 2 * cy / height - 1, 0],
            ]
        )
        view = np.diag([1.0, -1.0, -1.0, 1.0]) @ extrinsics
        return cls._made(view, xy, True, *_cuts(True, near, far), width / height, (width, height))

    @classmethod
    def fit(cls, scene, *, azimuth=30.0, elevation=20.0, up=(0, 1, 0), fov_y=45.0, margin=1.05):
        """A perspective that frames the scene's bounding sphere, whatever the image's size.

        It is fitted when it is used: what is added to a Scene meanwhile counts.

        Args:
            scene: Scene or what `Scene.add` takes. Without triangles, the unit sphere is framed.
            azimuth: degrees around `up`, counter-clockwise from above; 0 looks along −Z where `up` is +Y.
            elevation: degrees above the horizon.
            margin: factor on the distance at which the sphere touches the smaller field of view.
        """
        from .scene import as_scene

        up = _check.vector("up", up)
        if not up.any():
            raise ParameterError("up must not be zero")
        return _FittedCamera(
            as_scene(scene),
            _check.number("azimuth", azimuth),
            _check.number("elevation", elevation),
            up,
            _fov(fov_y),
            _check.number("margin", margin, 0, open_ends=True),
        )

    def project(self, points, width, height):
        """Where points land: xy (N, 2) in pixels and eye depth (N,), float64.

        Behind a perspective's eye, depth is negative and xy is NaN.

        Args:
            points: (N, 3) world positions.
        """
        points = _check.array_of_numbers("points", points, "fiu", ParameterError).astype(np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ParameterError(f"points must have shape (N, 3), got {points.shape}")
        view, projection = self.matrices(width, height)
        eye = points @ view[:3, :3].T + view[:3, 3]
        clip = eye @ projection[:, :3].T + projection[:, 3]
        w = np.where(clip[:, 3] > 0, clip[:, 3], np.nan)
        ndc = clip[:, :2] / w[:, None]
        return (ndc * (0.5, -0.5) + 0.5) * (width, height), -eye[:, 2]

    def matrices(self, width, height):
        """view (4, 4) and projection (4, 4), clip z from 0 at near to 1 at far, for an image of this size.

        Without near, z is cut at a 1e-6 of the unit; without far, at infinity.

        Raises:
            ParameterError: the camera is for another aspect ratio, by more than a pixel in width.
        """
        width, height = _size("width", width), _size("height", height)
        camera = self._at(width, height)
        projection = np.zeros((4, 4))
        projection[:2] = camera._xy
        if camera._aspect is None:
            projection[0] *= height / width
        elif abs(camera._aspect * height - width) > 1:
            raise ParameterError(
                f"the camera's aspect ratio is {camera._aspect:.6g}, but the image is {width}×{height}: "
                f"for this height its width is {camera._aspect * height:.6g}"
            )
        if camera._perspective:
            near, far = camera.near or 1e-6, camera.far
            # z = a·(−z_eye) + b with z/w = 0 at near and 1 at far.
            slope = 1.0 if far is None else far / (far - near)
            projection[2, 2:], projection[3, 2] = (-slope, -slope * near), -1
        else:
            near = camera.near or 0.0
            depth = 1e9 if camera.far is None else camera.far - near
            projection[2, 2:], projection[3, 3] = (-1 / depth, -near / depth), 1
        return camera._view.copy(), projection

    def _parts(self, width, height):
        """As the core takes it."""
        camera = self._at(width, height)
        view, projection = camera.matrices(width, height)
        return {"view": view, "projection": projection, "near": camera.near, "far": camera.far}

    @property
    def is_perspective(self) -> bool:
        return bool(self._perspective)

    @property
    def view(self) -> np.ndarray:
        """(4, 4) world to eye."""
        return _check.frozen(self._view)

    @property
    def near(self):
        """The eye depth before which nothing is drawn. None: nothing in front of the eye is cut."""
        return self._near

    @property
    def far(self):
        """The eye depth behind which nothing is drawn. None: nothing is cut."""
        return self._far

    def _at(self, width, height):
        """The camera for an image of this size, which becomes its own."""
        return Camera._made(**(self._fields() | {"size": (width, height)}))

    @classmethod
    def _perspective_of(cls, view, fov_y, near, far):
        focal = 1 / np.tan(np.radians(fov_y) / 2)
        return cls._made(view, np.array([[focal, 0, 0, 0], [0, focal, 0, 0]]), True, *_cuts(True, near, far))

    @classmethod
    def _made(cls, *fields, **more):
        """From what is known to be sound: see `_set`."""
        camera = cls.__new__(cls)
        camera._set(*fields, **more)
        return camera

    def _set(self, view, xy, perspective, near, far, aspect=None, size=None):
        """The only place that sets anything. `xy`: the projection's first two rows; aspect None: any, square pixels."""
        vars(self).update(
            _view=np.array(view, dtype=np.float64),
            _xy=np.array(xy, dtype=np.float64),
            _perspective=perspective,
            _near=near,
            _far=far,
            _aspect=aspect,
            _size=None if size is None else tuple(size),
        )

    def _fields(self):
        """The arguments of `_made`."""
        return {name: getattr(self, f"_{name}") for name in FIELDS}

    def __setattr__(self, field, value=None):
        raise AttributeError(f"a Camera is read-only: make another with another {field}")

    __delattr__ = __setattr__

    def __repr__(self):
        kind = "perspective" if self._perspective else "orthographic"
        return f"Camera({kind}, near={self.near}, far={self.far})"


FIELDS = ("view", "xy", "perspective", "near", "far", "aspect", "size")


class _FittedCamera(Camera):
    """A camera that waits for the scene to be complete and the image's size to be known."""

    def __init__(self, scene, azimuth, elevation, up, fov_y, margin):
        vars(self).update(_fit=(scene, azimuth, elevation, up, fov_y, margin))
        vars(self).update(_size=None, _aspect=None, _perspective=True, _near=None, _far=None)

    def _at(self, width, height):
        scene, azimuth, elevation, up, fov_y, margin = self._fit
        center, radius = scene.bounding_sphere()
        half = np.radians(fov_y) / 2
        smaller = min(half, np.arctan(np.tan(half) * width / height))
        a, e = np.radians([azimuth, elevation])
        towards_eye = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        turn = turn_y_to(up)
        eye = center + turn @ towards_eye * (margin * radius / np.sin(smaller))
        # Straight down, the horizon is up: the derivative of the direction with the elevation.
        top = turn @ np.array([-np.sin(a) * np.sin(e), np.cos(e), -np.cos(a) * np.sin(e)])
        return Camera._perspective_of(looking(eye, center, top), fov_y, None, None)._at(width, height)

    @property
    def view(self):
        return self._at(1, 1).view

    def __repr__(self):
        return "Camera.fit(...)"


def _cuts(perspective, near, far):
    """near and far as given to a constructor, checked: eye depths or None."""
    low = 0.0 if perspective else -np.inf
    near = None if near is None else _check.number("near", near, low, open_ends=perspective)
    endless = far is None or (np.isscalar(far) and far == np.inf)
    far = None if endless else _check.number("far", far, low, open_ends=perspective)
    if far is not None and far <= (near or 0.0):
        raise ParameterError(f"far must be beyond near, got near={near} far={far}")
    return near, far


def _size(name, value):
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not 1 <= value <= 16384:
        raise ParameterError(f"{name} must be an integer from 1 to 16384 pixels, got {value!r}")
    return int(value)


def _fov(fov_y):
    fov_y = _check.number("fov_y", fov_y, 0, 180, open_ends=True)
    if fov_y < 3.2:
        warnings.warn(f"fov_y is in degrees: {fov_y} is very narrow; radians?", UserWarning, stacklevel=3)
    return fov_y
