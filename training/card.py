"""The model card, made from a run: data, numbers, limits, hash."""

from typing import TYPE_CHECKING

from training.generator.dataset import counts_of
from training.generator.people import FAMILIES
from training.labels import PRIMITIVES

if TYPE_CHECKING:
    from training.train import Judged, Run


def _row(judged: "Judged") -> str:
    whole = judged.whole
    early = " | ".join(f"{s.f1:.3f}" for _, s in judged.early)
    error = "-" if judged.calibration is None else f"{judged.calibration:.3f}"
    return (
        f"| {judged.name} | {whole.accuracy:.3f} | {whole.f1:.3f}"
        f" | {whole.interval[0]:.3f} to {whole.interval[1]:.3f} | {early} | {error} |"
    )


def _confusion(judged: "Judged") -> str:
    head = f"| was \\ said | {' | '.join(PRIMITIVES)} |\n|{'---|' * (len(PRIMITIVES) + 1)}\n"
    rows = (
        f"| {label} | {' | '.join(str(n) for n in row)} |\n"
        for label, row in zip(PRIMITIVES, judged.whole.confusion.tolist(), strict=True)
    )
    return head + "".join(rows)


def primitives(multiple: float) -> int:
    """How many there are in a set of a multiple of the thesis' counts."""
    return sum(counts_of(multiple).values())


def card_of(run: "Run") -> str:
    """The card as Markdown."""
    first = run.judged[0]
    whole, preset = first.whole, run.preset
    early_head = " | ".join(f"F1 {after:g} s" for after, _ in first.early)
    families = "".join(
        f"| {family} | {' | '.join(f'{judged.families[family]:.3f}' for judged in run.judged)} |\n"
        for family in first.families
    )
    names = " | ".join(judged.name for judged in run.judged)
    epochs = len(run.fitted.history)
    return f"""# intent.onnx

Which primitive do the sticks draw: {", ".join(PRIMITIVES)}?
Written by `autocomplete train --preset {run.preset_name} --seed {run.seed}`; its figures for
programs are in intent.json, how it works is in docs/model.md.

- SHA-256: `{run.sha256}`
- Input: `sticks` (batch, time, 3) float32: vx, vy, vz as fractions of full stick at 50 Hz, in
  the frame of the heading at the window's start; `lengths` (batch,) int64. At most 200 samples.
- Output: `probabilities` (batch, {len(PRIMITIVES)}).
- ONNX against torch on test windows: largest difference {run.parity:.1e}.

## Data

Sticks of simulated operators only (training/generator): {len(FAMILIES)} families of hands and
pilots, and three sets of people that share nobody.

| set | operators | primitives |
|---|---|---|
| training | {preset.operators} | {primitives(preset.multiple)} |
| validation | {preset.validation_operators} | {primitives(preset.validation_multiple)} |
| test | {preset.test_operators} | {whole.count} |

Classes are as frequent as in the thesis. {epochs} epochs, temperature {run.fitted.temperature:.2f}.
Windows over 200 samples keep the newest 200.

## Figures on operators held out

n = {whole.count} primitives of {whole.operators} operators. F1 is weighted by class; the interval
is 95 % over operators (bootstrap). "F1 2 s" is asked two seconds after the motion began.
ECE is the expected calibration error at the end of the primitive, in 15 bins.

| classifier | accuracy | F1 | 95 % interval | {early_head} | ECE |
|{"---|" * (5 + len(first.early))}
{chr(10).join(_row(judged) for judged in run.judged)}

The SVM has C = 100, gamma = 0.001, 100 roll and 100 pitch samples, standardised. It is trained on
whole primitives, as many as the thesis has. It does not see vz, so it cannot tell a helix.

{first.name}:

{_confusion(first)}
| family, F1 | {names} |
|{"---|" * (1 + len(run.judged))}
{families}
## Limits

- No person's sticks are in the data. How well it does on people is not known.
- The operators held out are of the same families as those it learned from.
- It always answers one of {len(PRIMITIVES)}; rest and too short motions are the service's to tell.
- A wide slow sine looks like an arc until its inflection is within the 4 s window.
"""
