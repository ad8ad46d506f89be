"""A mission prepared for the kernels: checked and copied into C++ once, used by all of them.

Arguments of every kernel are converted here where nothing is lost, and refused by name
otherwise.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from swarm.kernels._kernels import KernelProblem

__all__ = ["converted", "prepare"]


_Scalar = TypeVar("_Scalar", bound=np.generic)


def converted(name: str, value: object, dtype: type[_Scalar], n_axes: int) -> npt.NDArray[_Scalar]:
    """``value`` as a contiguous array of ``dtype``.

    Raises:
        ValueError: it is not such an array, or would lose something in becoming one: numbers their
            fractions, or truth values their meaning.
    """
    try:
        array = np.asarray(value)
        lossless = array.size == 0 or np.can_cast(array.dtype, dtype, "same_kind")
        result = np.ascontiguousarray(array, dtype) if lossless else None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of {np.dtype(dtype)}: {error}") from error
    if result is None:
        raise ValueError(f"{name} must be an array of {np.dtype(dtype)}, not of {array.dtype}")
    if array.ndim != n_axes:  # ascontiguousarray turns a scalar into a row
        raise ValueError(f"{name} must have {n_axes} axes, not {array.ndim}")
    return result


def prepare(
    *,
    start_enu_m: npt.ArrayLike,
    task_enu_m: npt.ArrayLike,
    speed_m_s: npt.ArrayLike,
    value: npt.ArrayLike,
    service_s: npt.ArrayLike,
    success: npt.ArrayLike,
    survival: npt.ArrayLike,
    horizon_s: float,
) -> KernelProblem:
    """The handle that every kernel takes for the arrays of eq. 1.

    Args:
        start_enu_m: (n_uav, 3) starts [m; east, north, up from the mission origin].
        task_enu_m: (n_task, 3) task places [m; same frame].
        speed_m_s: (n_uav,) cruise speeds [m/s]; > 0.
        value: (n_task,) m_i; >= 0.
        service_s: (n_task,) time on the spot [s]; >= 0.
        success: (n_uav, n_task) p within 0..1; 0: incapable, never on the UAV's list.
        survival: (n_uav, n_task) probability of surviving the task, within 0..1.
        horizon_s: D [s]; > 0.

    Returns:
        It also knows, as read-only arrays, the (n_uav, n_task) ``weight`` p·m, and of which tasks
        each UAV is ``capable``.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
    """
    return KernelProblem(
        start_enu_m=converted("start_enu_m", start_enu_m, np.float64, 2),
        task_enu_m=converted("task_enu_m", task_enu_m, np.float64, 2),
        speed_m_s=converted("speed_m_s", speed_m_s, np.float64, 1),
        value=converted("value", value, np.float64, 1),
        service_s=converted("service_s", service_s, np.float64, 1),
        success=converted("success", success, np.float64, 2),
        survival=converted("survival", survival, np.float64, 2),
        horizon_s=float(horizon_s),
    )
