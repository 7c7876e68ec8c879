"""Arms, measured heads and the gap between them as nodes of a viser scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.arm.bodies import up_direction
from bha.arm.geometry import camera_frame, quaternions_of
from bha.viewer.colors import BASE, BESIDE, MEASURED, RIGID, PressureScale, linear_light
from bha.viewer.geometry import Layout, Picture, axes_with_z, base_frame, layout_of, picture
from bha.viewer.solids import Mesh, Solids, ball, convolution, cylinder

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.viewer.motions import Moment

Array = NDArray[np.float64]

#: Of arms beside the first one.
_BESIDE_OPACITY = 0.45
#: Radius of the ball of a measured head over the arm's reach; of the shaft and the head of an arrow, and its length.
_MARKER, _SHAFT, _POINT, _POINT_LENGTH = 0.012, 0.003, 0.008, 0.02
#: Of axes: length over the radius of the widest plate, so that they are seen beside it; radius over their length.
_AXES, _AXES_RADIUS = 1.4, 0.02
#: Light from all around, beside that from above: colours must stay those of the scale.
_AMBIENT = 1.3
#: Where the camera stands at first, in lengths of the arm from the middle of it: beside, before and above.
_CAMERA = (1.6, 0.9, 0.35)
#: In a narrow window: how much further away, and how far above the middle the arm is seen, in its lengths.
_NARROW_AWAY, _NARROW_UP = 1.9, 0.6
#: Of plates and rigid pieces, behind which heads and bellows are to be seen.
_PLATE_OPACITY = 0.45


class Scene:
    """The scene of one arm: :meth:`draw` shows a moment of each motion. Not for several threads at once."""

    def __init__(self, server: Any, arm: Arm, count: int = 1, *, compared: bool = False) -> None:
        """Put up what stands still: base, floor, frames.

        Args:
            server: a ``viser.ViserServer``.
            arm: the arm.
            count: how many arms are drawn; the first in the colours of its pressures, others in one colour, as glass.
            compared: whether there are measured heads.
        """
        self.layout = layout_of(arm)
        self.scale = PressureScale.of(arm)
        self._scene = server.scene
        self._arms = [
            _ArmNodes(self._scene, f"/arms/{k + 1}", self.layout, None if k == 0 else BESIDE[(k - 1) % len(BESIDE)])
            for k in range(count)
        ]
        reach = self.layout.reach
        self.frames = self._scene.add_batched_axes(
            "/frames",
            *_turned(np.zeros((arm.section_count, 3)), np.tile(np.eye(3), (arm.section_count, 1, 1))),
            batched_scales=np.array([section.plate_radius for section in self.layout.sections]),
            axes_length=_AXES,
            axes_radius=_AXES * _AXES_RADIUS,
        )
        self._markers = self._arrows = None
        if compared:
            mesh = ball()
            self._markers = self._scene.add_batched_meshes_simple(
                "/measured",
                mesh.vertices,
                mesh.faces,
                *_turned(np.zeros((arm.section_count, 3)), np.tile(np.eye(3), (arm.section_count, 1, 1))),
                batched_scales=np.full(arm.section_count, _MARKER * reach),
                batched_colors=linear_light(MEASURED),
                lod="off",
                cast_shadow=False,
            )
            self._arrows = self._scene.add_arrows(
                "/gap",
                np.zeros((arm.section_count, 2, 3)),
                MEASURED,
                shaft_radius=_SHAFT * reach,
                head_radius=_POINT * reach,
                head_length=_POINT_LENGTH * reach,
            )
        self._stand(server, arm)

    def _stand(self, server: Any, arm: Arm) -> None:
        """Light, floor, base, camera's frame, and where one looks from."""
        reach, up = self.layout.reach, up_direction(arm)
        rotation, origin = base_frame(arm)
        self._scene.set_up_direction(tuple(up))
        self._scene.configure_default_lights(True, cast_shadow=False)
        # No picture of surroundings: without a graphics card it takes seconds until that lights anything.
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=_AMBIENT)
        length = _AXES * self.layout.width
        self._scene.add_frame(
            "/base",
            wxyz=quaternions_of(rotation),
            position=origin,
            axes_length=1.2 * length,
            axes_radius=_AXES_RADIUS * length,
            origin_radius=0.0,
        )
        along = rotation[:, 2]
        # Below the arm wherever it bends to; below the base where it stands.
        lowest = min(0.0, float(along @ up)) * reach - self.layout.width
        cell = 10.0 ** np.floor(np.log10(reach / 2.0))
        size = float(np.ceil(2.2 * reach / cell) * cell)
        self._scene.add_grid(
            "/floor",
            width=size,
            height=size,
            plane="xy",
            wxyz=quaternions_of(axes_with_z(up)),
            position=origin + lowest * up,
            cell_size=cell,
            section_size=10.0 * cell,
            cell_thickness=0.8,
            section_thickness=1.0,
        )
        camera = camera_frame(arm.parameters.sensors)
        if not camera.is_base and not camera.is_mirrored:
            name = "/camera of the heads"
            wxyz = quaternions_of(camera.matrix)
            self._scene.add_frame(
                name, wxyz=wxyz, position=camera.position, axes_length=length, axes_radius=_AXES_RADIUS * length
            )
            self._scene.add_label(f"{name}/name", "camera")
        server.initial_camera.up = up
        self.look_from_afar(server.initial_camera)

    def look_from_afar(self, camera: Any, *, narrow: bool = False) -> None:
        """Let a camera of viser's see the whole arm; where the window is narrow, above the controls."""
        arm, size = self.layout.arm, self.layout.size
        up = up_direction(arm)
        rotation, origin = base_frame(arm)
        away = _NARROW_AWAY if narrow else 1.0
        middle = origin + 0.6 * size * rotation[:, 2] - (_NARROW_UP * size * up if narrow else 0.0)
        camera.position = middle + away * size * axes_with_z(up) @ np.array(_CAMERA)
        camera.look_at = middle

    def caption(self, text: str) -> None:
        """Put a line of text above the base."""
        arm = self.layout.arm
        _, origin = base_frame(arm)
        self._scene.add_label("/caption", text, position=origin + 0.08 * self.layout.reach * up_direction(arm))

    def draw(self, moments: Sequence[Moment], magnify: float = 1.0) -> None:
        """Show a moment of each arm; the gap of the first one, ``magnify`` times as long."""
        for nodes, moment in zip(self._arms, moments, strict=True):
            nodes.draw(moment, self.scale)
        shown = self._arms[0].shown
        self.frames.visible = self.frames_wanted and shown is not None
        if shown is not None:
            self.frames.batched_wxyzs, self.frames.batched_positions = _turned(shown.heads, shown.head_rotations)
        if self._markers is not None and self._arrows is not None:
            moment = moments[0]
            there = np.asarray(np.isfinite(moment.gap).all(axis=-1))
            known = np.asarray(np.isfinite(moment.measured).all(axis=-1))
            self._markers.visible = bool(known.any())
            # What is not known is nowhere: as small as nothing.
            self._markers.batched_scales = np.where(known, _MARKER * self.layout.reach, 1e-9).astype(np.float32)
            self._markers.batched_positions = np.nan_to_num(moment.measured).astype(np.float32)
            start = np.where(there[:, None], moment.heads, 0.0)
            end = start + np.where(there[:, None], magnify * moment.gap, 0.0)
            self._arrows.visible = bool(there.any())
            self._arrows.points = np.stack([start, end], axis=1)[there].astype(np.float32)

    #: Whether axes are shown at the heads.
    frames_wanted = True


class _ArmNodes:
    """The nodes of one arm."""

    def __init__(self, scene: Any, name: str, layout: Layout, color: tuple[int, int, int] | None) -> None:
        self._layout, self._by_pressure = layout, color is None
        self.shown: Picture | None = None
        straight = picture(layout, np.concatenate([[s.rest_length] * 3 for s in layout.arm.parameters.sections]))
        glass = None if color is None else _BESIDE_OPACITY
        rigid = np.tile(np.array(RIGID if color is None else color, dtype=np.uint8), (len(straight.plates), 1))
        if color is None:
            rigid[0] = BASE
        folds = np.tile(np.array(color or RIGID, dtype=np.uint8), (len(straight.folds), 1))
        self._folds = _instances(scene, f"{name}/bellows", convolution(), straight.folds, folds, opacity=glass)
        clear = np.full(len(straight.plates), glass or _PLATE_OPACITY)
        clear[0] = glass or 1.0
        self._plates = _instances(scene, f"{name}/plates", cylinder(), straight.plates, rigid, batched_opacities=clear)
        self._pressures = np.full(len(layout.arm.inputs), np.inf)  # of no moment

    def draw(self, moment: Moment, scale: PressureScale) -> None:
        """Show the arm at a moment; not where its lengths are not known."""
        known = bool(np.isfinite(moment.lengths).all())
        self._folds.visible = self._plates.visible = known
        self.shown = picture(self._layout, moment.lengths) if known else None
        if self.shown is None:
            return
        for node, solids in ((self._folds, self.shown.folds), (self._plates, self.shown.plates)):
            node.batched_wxyzs, node.batched_positions = _turned(solids.positions, solids.rotations)
        self._folds.batched_scales = self.shown.folds.scales.astype(np.float32)
        if self._by_pressure and not np.array_equal(moment.pressures, self._pressures, equal_nan=True):
            self._pressures = moment.pressures
            colors = scale.colors(moment.pressures[self._layout.fold_inputs])
            self._folds.batched_colors = linear_light(colors)


def _instances(scene: Any, name: str, mesh: Mesh, solids: Solids, colors: NDArray[np.uint8], **opacity: Any) -> Any:
    return scene.add_batched_meshes_simple(
        name,
        mesh.vertices,
        mesh.faces,
        *_turned(solids.positions, solids.rotations),
        batched_scales=solids.scales,
        batched_colors=linear_light(colors),
        **opacity,
        lod="off",
        cast_shadow=False,
        receive_shadow=False,
    )


def _turned(positions: Array, rotations: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Quaternions (k, 4), scalar first, and positions (k, 3), as viser sends them."""
    return quaternions_of(rotations).astype(np.float32), positions.astype(np.float32)
