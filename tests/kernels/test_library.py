"""Object code is loaded for the machine that it was compiled for."""

import os
import subprocess
import sys

import llvmlite.binding as llvm
import pytest

from piazzi.kernels import library

OPTIONS = """
import llvmlite.binding as llvm
import functools
handed, create = [], llvm.Target.create_target_machine

@functools.wraps(create)
def create_and_note(self, **options):
    handed.append((self.triple, options))
    return create(self, **options)

llvm.Target.create_target_machine = create_and_note
from piazzi.kernels.settings import own_settings
with own_settings():
    from numba.core.registry import cpu_target
    cpu_target.target_context.codegen()
compiler = handed.pop()
from piazzi.kernels.library import load_objects
module = llvm.parse_assembly("define void @f() { ret void }")
llvm.initialize_native_target()
llvm.initialize_native_asmprinter()
machine = create(llvm.Target.from_default_triple())
load_objects({"f": machine.emit_object(module)}, {"f": ("f", ())}, {})["f"]()
loader = handed.pop()
assert int(compiler[1].pop("opt")) == loader[1].pop("opt")
assert loader == compiler, (loader, compiler)
"""


def test_the_loader_has_the_options_of_the_compiler():
    """Whatever they are in this version, on this machine; in a process of its own, because Numba makes its machine once."""
    done = subprocess.run([sys.executable, "-c", OPTIONS], env=os.environ, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("family", ["x86-64", "x86", "aarch64", "arm64", "ppc64le", "riscv64"])
def test_and_would_have_on_other_processors(monkeypatch, family):
    from numba.core.codegen import JITCPUCodegen

    class Other(JITCPUCodegen):
        def __init__(self):
            self._tm_features = self._customize_tm_features()

    library._prepare()
    monkeypatch.setattr(llvm.Target, "name", property(lambda self: family))
    wanted: dict[str, object] = {}
    Other()._customize_tm_options(wanted)
    found = library.machine_options()
    assert found.pop("opt") == 3
    assert found == wanted
