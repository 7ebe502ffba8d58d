"""Validated records: frozen classes for robots and scenes, whose errors are one sentence.

A field's ``description`` is what its `SceneError` says was expected, so that each quantity, its
unit and its range are written once, where the field is declared.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from inspect import Parameter, Signature, signature
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Self, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)

from deltaopt.errors import SceneError, shown
from deltaopt.files.units import Misread, Quantity
from deltaopt.files.yaml_file import placed_in
from deltaopt.settings import holds_numbers

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)

Name = Annotated[str, Field(strict=True, max_length=200, pattern=r"^[^\p{C}\p{Zl}\p{Zp}]+$")]
"""A line of text without control characters, for terminals, pictures, and comments of programs."""

LARGEST = 1e12
"""Largest size of a number in a record, in SI units: far beyond any robot, and its square and those
of its products with others are still numbers."""

_FEW = 4
"""Names of fields that a sentence tells."""

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
NonNegative = Annotated[Number, Field(ge=0)]
Positive = Annotated[Number, Field(gt=0)]
Below1 = Annotated[Positive, Field(lt=1)]
Text = Annotated[str, Field(strict=True, min_length=1)]

Triple = tuple[Number, Number, Number]
"""Three numbers of a file, such as a vector's."""
Vector3 = tuple[float, float, float]
PerMotor = Positive | tuple[Positive, Positive, Positive]
"""One positive number for all three motors, or one for each."""


def vector3(values: Iterable[float]) -> Vector3:
    """Three numbers, such as those of an array, as a vector."""
    x, y, z = map(float, values)
    return x, y, z


def described(kind: Any) -> str | None:
    """What is expected of a number, or of one for each motor, by its type: "a length in m, greater
    than 0"; None where the type does not tell."""
    kinds = get_args(kind)
    marks = get_args(kinds[0]) if NoneType in kinds else kinds
    quantity = next((each for each in marks if isinstance(each, Quantity)), None)
    if quantity is None:
        return None
    if marks[0] == PerMotor:
        return f"one {quantity.words.partition(' ')[2]}, greater than 0, or three"
    ranges = {
        "greater than 0": Positive,
        "at least 0": NonNegative,
        "greater than 0 and below 1": Below1,
    }
    own = (words for words, kind in ranges.items() if marks[:-1] == get_args(kind))
    return next((f"{quantity.words}, {words}" for words in own), None)


def optional(expected: str, **rules: Any) -> Any:
    """A key that may be left out: what it is expected to be, and rules of pydantic for it."""
    return Field(default=None, description=expected, **rules)


def per_motor(limit: float | Vector3) -> Vector3:
    """The limit of each motor, from one number for all or one for each."""
    return limit if isinstance(limit, tuple) else (limit, limit, limit)


class _Listed(ModelMetaclass):
    """Lists in ``help`` what a record is for, and not all that pydantic's models can do."""

    def __dir__(self) -> list[str]:
        inherited = {*dir(BaseModel), "fields_hash", "from_content"} - {"model_copy"}
        return [name for name in super().__dir__() if name not in inherited and name[:2] != "__"]


class Record(BaseModel, metaclass=_Listed):
    """A frozen record; a value that cannot be used raises a `SceneError` that names its key."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Describe fields whose types say what is expected, and give names and defaults alone as
        the signature: types with their units fill a screen."""
        kinds = get_type_hints(cls, include_extras=True)
        for name, field in cls.model_fields.items():
            field.description = field.description or described(kinds.get(name))
        parameters = signature(cls).parameters.values()
        plain = [each.replace(annotation=Parameter.empty) for each in parameters]
        cls.__signature__ = Signature(plain)

    def __new__(cls, *given: object, **_: object) -> Self:
        """Raise TypeError for values without names."""
        if given:
            files = "; load_scene and load_robot read files" * isinstance(given[0], str | Path)
            told = f"{cls.__name__} is given {shown(given[0])}; it takes values by name, such as"
            raise TypeError(f"{told} {', '.join(cls._keys()[:_FEW])}{files}")
        return super().__new__(cls)

    def __repr_args__(self) -> Iterator[tuple[str, Any]]:
        """The fields that differ from what they are where they are not given."""
        fields = type(self).model_fields
        yield from ((name, value) for name, value in self if value != fields[name].default)

    @classmethod
    def from_content(cls, content: dict[str, object], file: Path) -> Self:
        """Make a record from the content of a file.

        Raises SceneError, naming file and key, if a key is unknown or missing or a value wrong.
        """
        with placed_in(file):
            return cls.model_validate(content)

    @cached_property
    def fields_hash(self) -> int:
        """The hash of all fields, computed once: caches look robots and scenes up often."""
        return hash(tuple(getattr(self, name) for name in type(self).model_fields))

    def __hash__(self) -> int:
        return self.fields_hash

    def __iter__(self) -> Generator[tuple[str, Any], None, None]:
        """Names and values of the fields, so that ``dict(record)`` makes the same record; without
        what was computed once for this one."""
        yield from ((name, getattr(self, name)) for name in type(self).model_fields)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other fields; without what was computed once for this one.

        Each of these is validated by itself, but not held against the others. Raises SceneError
        where it cannot be used.
        """
        given = {key: self._validated(key, value) for key, value in (update or {}).items()}
        copied = super().model_copy(update=given, deep=deep)
        for name in set(copied.__dict__) - set(type(self).model_fields):
            del copied.__dict__[name]
        return copied

    def _validated(self, key: str, value: object) -> object:
        """A value of a field as the record would have it."""
        if key not in type(self).model_fields:
            raise SceneError(None, key, value, self._nearest(key), "is not a known key")
        return self._valid(key, value)

    @classmethod
    def _valid(cls, key: str, value: object) -> Any:
        """A value of a field as the record would have it; raises SceneError, naming its key."""
        return cls._checked(key, value, _adapter(cls, key).validate_python)

    @classmethod
    def _checked(cls, key: str, value: Any, validate: Callable[[Any], Any]) -> Any:
        """The valid value of a field; raises SceneError, naming its key."""
        expected = str(cls.model_fields[key].description)
        what = _misleads(value)
        if what:
            raise SceneError(None, key, value, expected, f"is {shown(value)}, {what}")
        try:
            return validate(value)
        except SceneError as error:  # from a record within this one
            raise error.inside(key=f"{key}{_place_in_list(cls, key, value)}") from None
        except ValidationError as error:
            problem, hint = _misread(value, error)
            raise SceneError(None, key, value, expected + hint, problem) from None

    @model_validator(mode="before")
    @classmethod
    def _with_known_keys(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        read = cls._read(content)
        for key, value in read.items():
            if key not in cls.model_fields:
                raise SceneError(None, key, value, cls._nearest(key), "is not a known key")
        for key, field in cls.model_fields.items():
            if field.is_required() and key not in read:
                raise SceneError(None, key, None, str(field.description), "is missing")
        return read

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        """The values of the fields from the keys that a file may have. Raises SceneError."""
        return content

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        self.require_consistent()
        return self

    def require_consistent(self) -> None:
        """Raise SceneError where fields that are right one by one do not go together."""

    @classmethod
    def _nearest(cls, key: str) -> str:
        near = difflib.get_close_matches(key, cls._keys(), n=1)
        return near[0] if near else "one of " + ", ".join(cls._keys())

    @classmethod
    def _keys(cls) -> list[str]:
        """The keys that a file may have."""
        return list(cls.model_fields)

    @field_validator("*", mode="wrap")
    @classmethod
    def _check_value(
        cls, value: Any, validate: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> Any:
        return cls._checked(str(info.field_name), value, validate)


@lru_cache(maxsize=64)
def _adapter(record: type[Record], key: str) -> TypeAdapter[Any]:
    """What validates a single field of a record."""
    field = record.model_fields[key]
    kind: Any = field.annotation
    return TypeAdapter(Annotated[(kind, *field.metadata)] if field.metadata else kind)


def _place_in_list(record: type[Record], key: str, value: object) -> str:
    """Which record of a list cannot be used, as "[2]", counted from 0; empty if the field is no
    list of records."""
    kind = record.model_fields[key].annotation
    lists = [one for one in (kind, *get_args(kind)) if get_origin(one) is tuple]
    if not (lists and isinstance(value, list | tuple)):
        return ""
    adapter = TypeAdapter[Any](get_args(lists[0])[0])
    return f"[{next(i for i, each in enumerate(value) if not _is_valid(adapter, each))}]"


def _is_valid(adapter: TypeAdapter[Any], value: object) -> bool:
    try:
        adapter.validate_python(value)
    except (SceneError, ValidationError):
        return False
    return True


def _misread(value: object, error: ValidationError) -> tuple[str, str]:
    """What is wrong with a value that is no such quantity, and what more would be right; both empty
    if something else is wrong."""
    for detail in error.errors(include_url=False):
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, Misread):
            which = "which" if value == cause.value else f"of which {shown(cause.value)}"
            return f"is {shown(value)}, {which} {cause.problem}", cause.hint
    return "", ""


def _misleads(value: object) -> str:
    """What a value is, alone or in a list, of which numbers could be made that nobody meant."""
    if isinstance(value, list | tuple):
        return next(filter(None, map(_misleads, value)), "")
    if isinstance(value, set | frozenset):
        return "a set without order"
    is_of_numpy = isinstance(value, np.ndarray | np.generic)
    return "" if not is_of_numpy or holds_numbers(value) else "not all real numbers"
