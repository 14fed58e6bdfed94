"""A signature as text for a terminal."""

from __future__ import annotations

import math

import numpy as np

from gearmon.signatures.signature import Signature


def signature_lines(signature: Signature, most: int = 30) -> list[str]:
    """Return a compact table: what holds for each stage, then its strongest lines by frequency.

    Parameters
    ----------
    signature : Signature
        What to show.
    most : int
        Largest number of lines, taken by acceleration.
    """
    lines = [f"{signature.machine or 'machine'}: {signature.origin} signature"]
    for stage in signature.header.get("stages", []):
        lines += _stage_lines(stage)
    strongest = np.sort(np.argsort(-signature["acceleration_ms2"], kind="stable")[:most])
    strongest = strongest[np.argsort(signature["frequency_hz"][strongest], kind="stable")]
    lines.append("")
    lines.append(
        f"{'stage':>5} {'line':<18} {'order':>10} {'Hz':>10} {'displacement um':>16} "
        f"{'velocity mm/s':>14} {'acceleration m/s2':>18} {'phase deg':>10}"
    )
    lines += [_line(signature, int(index)) for index in strongest]
    if len(signature) > len(strongest):
        lines.append(f"({len(strongest)} strongest of {len(signature)} lines; peak amplitudes)")
    else:
        lines.append("(peak amplitudes)")
    return lines


def line_name(mesh_harmonic: int, sideband: int, sideband_of: str) -> str:
    """Return the name of a line, such as "mesh 2", "mesh 2 -3 pinion" or "5 pinion".

    Examples
    --------
    >>> line_name(2, -3, "pinion")
    'mesh 2 -3 pinion'
    """
    if not sideband:
        return f"mesh {mesh_harmonic}"
    if not mesh_harmonic:
        return f"{sideband} {sideband_of}"
    return f"mesh {mesh_harmonic} {sideband:+d} {sideband_of}"


def _line(signature: Signature, index: int) -> str:
    name = line_name(
        int(signature["mesh_harmonic"][index]),
        int(signature["sideband"][index]),
        str(signature["sideband_of"][index]),
    )
    return (
        f"{signature['stage'][index]:>5} {name:<18} {signature['order'][index]:>10.4f} "
        f"{signature['frequency_hz'][index]:>10.2f} "
        f"{1e6 * signature['displacement_m'][index]:>16.4g} "
        f"{1e3 * signature['velocity_ms'][index]:>14.4g} "
        f"{signature['acceleration_ms2'][index]:>18.4g} "
        f"{math.degrees(signature['phase_rad'][index]):>10.1f}"
    )


def _stage_lines(stage: dict[str, object]) -> list[str]:
    """Return what holds for one stage, as far as the header tells it."""
    shown = (
        ("mesh frequency", "mesh_frequency_hz", "Hz"),
        ("mean stiffness", "mean_stiffness_n_per_m", "N/m"),
        ("stiffness variation", "stiffness_variation", ""),
        ("contact ratio", "contact_ratio", ""),
        ("natural frequency", "natural_frequency_hz", "Hz"),
        ("damping ratio", "damping_ratio", ""),
        ("error bound", "error_bound", ""),
    )
    parts = [
        f"{label} {stage[key]:.5g}{' ' + unit if unit else ''}"
        for label, key, unit in shown
        if isinstance(stage.get(key), float)
    ]
    lines = [f"stage {stage.get('stage', 1)}: {', '.join(parts)}"]
    if stage.get("message"):
        lines.append(f"  {stage['message']}")
    if stage.get("contact_lost"):
        lines.append("  teeth lose contact in every period: the linear model ends there")
    return lines
