from .kit import check_component as check_component
from .kit import check_names as check_names
from .outcomes import CheckResult as CheckResult
from .parametrisation import ConformanceCheck as ConformanceCheck
from .parametrisation import conformance as conformance
