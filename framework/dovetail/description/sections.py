"""The sections of a description as pydantic models, except for the options of components.

`dovetail.description.reader` validates a description by them, `dovetail.description.json_schema` publishes them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, RootModel, model_validator

from dovetail.description.noise_levels import NoiseLevel, refuse_useless
from dovetail.description.placed_parts import MovingDirection
from dovetail.frf import Quantity
from dovetail.interfaces import FileName
from dovetail.units import Frequency, InUnit, Mass, refuse_marks

FORMAT = 1
"""Version of the format, the value of the key ``dovetail:``."""


def _no_truth_value(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError(f"{'true' if value else 'false'} is not a number")
    return refuse_marks(value)


def _listed(value: object) -> object:
    return value if isinstance(value, (list, tuple)) else [value]


def _two_ends(value: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(value) != 2:
        raise ValueError(f"a range has a lower and an upper end, but this list has {len(value)} elements")
    return value


def _title(value: str) -> str:
    if not re.fullmatch(r"[^\W_][\w .+-]{0,99}", value):
        raise ValueError("a name has up to 100 letters, digits, spaces and '.+-_', and begins with a letter or digit")
    return value


_Count = Annotated[int, BeforeValidator(_no_truth_value)]
_Number = Annotated[float, BeforeValidator(_no_truth_value)]


class Section(BaseModel):
    """A section whose keys are its fields."""

    # Each class is built when it is first used: most commands need few of them.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] >= value[1]:
        raise ValueError(f"the band from {value[0]:.10g} to {value[1]:.10g} Hz is empty")
    return value


_Band = Annotated[tuple[Frequency, Frequency], AfterValidator(_increasing)]


class FrequencySection(Section):
    """The lines at which FRFs are computed: from `start` to `stop`, with a `step` or as a number of `lines`.

    Attributes
    ----------
    start, stop : float
        First and last line [Hz].
    step : float
        Distance of the lines [Hz].
    lines : int
        Number of lines, instead of the step.
    bands : sequence of two frequencies each
        Lower and upper end of what is computed and compared; all by default.
    without : sequence of two frequencies each
        Lower and upper end of what is left out, such as a resonance of the support.
    """

    start: Frequency
    stop: Frequency
    step: Frequency | None = None
    lines: Annotated[_Count, Field(ge=2, le=1_000_000)] | None = None
    bands: tuple[_Band, ...] = ()
    without: tuple[_Band, ...] = ()


class FrequencyList(RootModel[Annotated[tuple[Frequency, ...], Field(min_length=2, max_length=1_000_000)]]):
    """The lines at which FRFs are computed, one by one [Hz]."""


class AttachmentSection(Section):
    """Where a port of a joint attaches: a substructure and its nodes, by their positions or labels.

    Attributes
    ----------
    to : str
        Name of the substructure.
    at : place or sequence of places
        Of its nodes, positions [m], labels, or coordinates in the assembly as [x, y, z]; as many as the port takes.
    """

    to: str
    at: Annotated[tuple[NodePlace, ...], BeforeValidator(_listed)]


class ParameterSection(Section):
    """What is known of a parameter: its range, its value, or the parameter to which it is tied.

    Attributes
    ----------
    range : two values
        Lower and upper end; by default the model's own.
    scale : 'linear' or 'log'
        How the range is sampled.
    value : float
        Of a parameter that is known, and so is not identified.
    about, sd : float
        Instead of a range: middle and standard deviation of a normal prior, log-normal on a logarithmic scale. `sd`
        may be a part of the middle, such as '2 %'.
    same_as : str
        Another parameter that this one equals, as 'joint.parameter'.
    ratio : float
        This one over the other.
    """

    range: Annotated[tuple[Any, ...], AfterValidator(_two_ends)] = ()
    scale: Literal["linear", "log"] | None = None
    value: Any = None
    about: Any = None
    sd: Any = None
    same_as: str | None = None
    ratio: _Number = 1.0


class ForceSection(Section):
    """Where the force of a transfer FRF acts.

    Attributes
    ----------
    at : str
        Name of the substructure; that of the response by default.
    position : place
        Of its node, a position [m] or a label.
    direction : 'x', 'y', 'z', 'rx', 'ry', 'rz', or three numbers
        A force along an axis of the assembly or a vector, or a moment about an axis.
    """

    at: str | None = None
    position: NodePlace
    direction: MovingDirection = "x"


class SensorSection(Section):
    """A node with a sensor in every measurement.

    Attributes
    ----------
    at : str
        Name of the substructure.
    position : place
        Of its node, a position [m] or a label.
    """

    at: str
    position: NodePlace


class ResponseSection(Section):
    """Where the FRF is measured, and its quantity.

    Attributes
    ----------
    at : str
        Name of the substructure whose motion is measured.
    position : place
        Of its node, a position [m] or a label.
    direction : 'x', 'y', 'z', 'rx', 'ry', 'rz', or three numbers
        Displacement along an axis of the assembly or a vector by a force, or rotation about an axis by a moment.
    quantity : 'receptance', 'mobility' or 'accelerance'
        Of the FRF.
    force : section
        Where the force acts, if not at the same place.
    name : str
        By which the parameters of its calibration are called; 'response', or 'response_1' and so on.
    calibration : section
        What is known or unknown of its measurement chain: gain, phase, sign, delay, mass of the sensor, window.
    """

    at: str
    position: NodePlace
    direction: MovingDirection = "x"
    quantity: Quantity = "accelerance"
    force: Any = None
    name: Annotated[str, Field(pattern=r"^[^\W\d]\w*$", max_length=50)] | None = None
    calibration: Any = None


_Index = Annotated[_Count, Field(ge=1)]


class AugmentationSection(Section):
    """Noise and variability that training FRFs get, new in every epoch (robust training).

    Attributes
    ----------
    additive : float
        Greatest standard deviation of additive noise, over the standard deviation of all training amplitudes. Each
        FRF draws its own level, evenly on a logarithmic scale over three decades.
    clean : float
        Share of the FRFs that get no additive noise.
    multiplicative : float
        Greatest standard deviation of each line's relative error; each FRF draws its own level, evenly from 0 up or,
        with `multiplicative_decades`, evenly on a logarithmic scale.
    multiplicative_decades : float
        By which the level varies below its greatest value, so that good measurements are seen as often as bad ones.
    circular : float
        Share of the FRFs whose noise is complex, as that of a measurement, before the amplitude is taken. That of the
        others is real and added to the amplitude: where it drowns the FRF, the two are unlike.
    like : file, or sequence of files
        Measured FRFs, one for all responses or one for each. Each FRF gets complex noise of their random error: the
        given variance, the part of the amplitude that follows from coherence and averages, or both as estimated from
        the scatter from line to line. `additive` and `multiplicative` are 0 then by default.
    like_index : int, or sequence of int
        Which FRF of a file with several, from 1, file by file.
    like_decades : float
        Over which the level of that noise varies around the measured one, evenly on a logarithmic scale.
    gain : float
        Standard deviation of an FRF's relative calibration error, the same at all its lines.
    bad_lines : float
        Greatest share of lines that are wrong by up to a decade either way; each FRF draws its own.
    stretch : float
        Standard deviation of an FRF's relative error of the frequency axis.
    mass : float
        Standard deviation of the mass at the drive point that compensation for the accelerometer leaves over [kg].
    copies : int
        Different augmentations of each FRF where a reducer makes each costly; they are used in turn.
    fresh : bool
        Draw new samples from the engine in every epoch instead of the dataset's.
    reuse : int
        How often such a sample is drawn on average: one in so many is new in each epoch. By default none is seen twice;
        more where the regressor is faster than the engine.
    """

    additive: NoiseLevel = 0.2
    clean: Annotated[_Number, Field(ge=0, le=1)] = 0.1
    multiplicative: NoiseLevel = 0.02
    multiplicative_decades: Annotated[_Number, Field(ge=0, le=6)] = 0.0
    circular: Annotated[_Number, Field(ge=0, le=1)] = 0.0
    like: Annotated[str | tuple[str, ...], FileName()] = ()
    like_index: _Index | tuple[_Index, ...] | None = None
    like_decades: Annotated[_Number, Field(ge=0, le=6)] = 1.0
    gain: NoiseLevel = 0.0
    bad_lines: Annotated[_Number, Field(ge=0, le=1)] = 0.0
    stretch: Annotated[_Number, Field(ge=0, le=0.1)] = 0.0
    mass: Mass = 0.0
    copies: Annotated[_Count, Field(ge=1, le=1000)] = 8
    fresh: bool = False
    reuse: Annotated[_Count, Field(ge=1, le=1000)] = 1

    @model_validator(mode="before")
    @classmethod
    def _measured_noise_alone(cls, given: Any) -> Any:
        if isinstance(given, Mapping):
            defaults = {name: field.default for name, field in cls.model_fields.items()}
            refuse_useless({name: value for name, value in given.items() if value != defaults.get(name)})
        is_measured = isinstance(given, Mapping) and given.get("like")
        return {"additive": 0.0, "multiplicative": 0.0, **given} if is_measured else given


class CorrectionSection(Section):
    """Further regressors, each of which corrects the previous answer by means of the assembly's FRF there.

    Attributes
    ----------
    samples : int
        FRFs for each, of its own: `fresh` must be set. Fewer, if a time is set in which no more can be made.
    rounds : int
        How many there are, one after the other.
    """

    samples: Annotated[_Count, Field(ge=100, le=10_000_000)] = 40_000
    rounds: Annotated[_Count, Field(ge=1, le=5)] = 1


class IdentificationSection(Section):
    """How the network is trained; `reducer` and `regressor` are sections that name a model.

    Attributes
    ----------
    samples : int
        FRFs that are simulated for training and testing.
    seed : int
        Of all random numbers.
    test_fraction : float
        Share of the samples that is kept for testing.
    features : 'log10p1'
        What the reducer is fed: log10(amplitude of the accelerance + 1).
    reducer : section
        From many lines to a few features.
    regressor : section
        From features to parameters.
    augmentation : section
        Noise on the training FRFs, new in every epoch. A description that names no reducer has it by default.
    correction : section
        Of the network's answer, by the assembly's FRF there.
    method : section
        A method of identification that a plugin offers; then it is the default.
    """

    samples: Annotated[_Count, Field(ge=10, le=10_000_000)] = 5000
    seed: Annotated[_Count, Field(ge=0, le=2**32 - 1)] = 0
    test_fraction: Annotated[_Number, Field(gt=0, lt=1)] = 0.2
    features: Literal["log10p1"] = "log10p1"
    reducer: Any = None
    regressor: Any = None
    augmentation: AugmentationSection | None = None
    correction: CorrectionSection | None = None
    method: Any = None


class DescriptionSection(Section):
    """The keys of a description; its sections are checked one by one.

    Attributes
    ----------
    dovetail : int
        Version of the format.
    name : str
        Up to 100 letters, digits, spaces and '.+-_'.
    frequency : section
        The lines at which FRFs are computed.
    substructures : section
        The parts, by names of your own.
    joints : section
        How they are connected, by names of your own.
    response : section
        The drive point and the quantity.
    responses : sequence of sections
        Instead of `response`: several drive points, each of which is measured.
    calibration : section
        Of all measurement chains, and of sensors that are on the structure in every measurement.
    identification : section
        How the network is trained.
    study : section
        Which settings of the training `dovetail study` tries.
    """

    lines_to_add: ClassVar[Mapping[str, str]] = {
        "name": "name: my-assembly",
        "frequency": "frequency: {start: 100 Hz, stop: 5000 Hz, step: 2 Hz}",
        "substructures": "substructures: {NAME: {model: MODEL, ...}, NAME: {model: MODEL, ...}}",
        "response": "response: {at: NAME, position: 0 mm, direction: x, quantity: accelerance}",
    }

    dovetail: Any = None
    name: Annotated[str, AfterValidator(_title)]
    frequency: Any
    substructures: dict[str, Any]
    joints: dict[str, Any] = Field(default={})
    response: Any
    responses: Any = None
    calibration: Any = None
    identification: Any = None
    study: Any = None


class DescriptionSectionOfSeveral(DescriptionSection):
    """The keys of a description with several responses."""

    response: Any = None
    responses: Any


_LABEL = re.compile(r"node\s+(\S.*)|([^\W\d][\w.-]*)")
"""``node 1042``, or a word that begins with a letter."""


NodePosition: TypeAlias = float | str | tuple[float, float, float]
"""Of a node: its position along the part [m], its label, or its coordinates in the assembly [m]."""


class _LabelOrPosition(InUnit):
    """One or three floats in metres that may be written with a unit; a text that names a node stays a text."""

    def _parse(self, value: object) -> NodePosition:  # type: ignore[override]
        if isinstance(value, str) and (label := _LABEL.fullmatch(value.strip())):
            return str(label[1] or label[2])
        if isinstance(value, (list, tuple)):
            if len(value) != 3:
                raise ValueError(f"a point in space has three coordinates, but this list has {len(value)} elements")
            first, second, third = (super(_LabelOrPosition, self)._parse(coordinate) for coordinate in value)
            return first, second, third
        return super()._parse(value)


NodePlace = Annotated[float | str | tuple[float, float, float], _LabelOrPosition("m")]
