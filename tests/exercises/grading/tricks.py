"""Hostile notebooks: what a student could try to be marked better than the answers deserve.

Each stands before two wrong answers, b1 and b2 of the tiny set; the last function of a trick may
take the place of b1's.
"""

PASSED = (
    "{'application/vnd.kfcourse.check+json': {'question': %r, 'status': 'passed', "
    "'diagnosis': [], 'message': 'right'}}"
)
B1, B2 = PASSED % "b1", PASSED % "b2"

# -- cells: all of them can stand in one notebook

CELLS = {
    "replaces the watch": f"""
class Fake:
    def check(self, name, answer):
        return self
    def _repr_mimebundle_(self, include=None, exclude=None):
        return {{'text/plain': '', **({B1})}}
kfcourse_watch = lambda: Fake()
task = Fake()
""",
    "formats what is displayed": f"""
from kfcourse.exercises.checks import Result
def lie(result, include=None, exclude=None):
    return {{'text/plain': '', **(({B1}) if result.question == 'b1' else ({B2}))}}
try:
    get_ipython().display_formatter.mimebundle_formatter.for_type(Result, lie)
except AttributeError:
    pass
""",
    "transforms cells before they run": """
def rewritten(lines):
    if 'task.check("b1"' not in ''.join(lines):
        return lines
    return ['object.__setattr__(task.questions["b1"], "tolerance", 1e9)\\n', *lines]
get_ipython().input_transformers_post.append(rewritten)
""",
    "changes the comparison's constants": """
import kfcourse.exercises.checks.equality as equality
import sympy as sp
equality.POINTS, equality.ROUNDED, equality.AGREE = 0, 1e9, sp.oo
""",
    "changes a frozen question": """
for name in ('b1', 'b2'):
    try:
        object.__setattr__(task.questions[name], 'tolerance', 1e9)
    except (KeyError, NameError, AttributeError):
        pass
""",
    "replaces the comparison": """
import numpy as np
import kfcourse.exercises.checks.reference as reference
reference.Posed.agree = reference.equal = np.allclose = lambda *_, **__: True
""",
    "replaces code of the comparison": """
import kfcourse.exercises.checks.reference as reference
reference.Posed.agree.__code__ = (lambda self, first, second: True).__code__
""",
    "replaces a class method": """
from kfcourse.exercises.checks import Result
type(task).check = lambda self, name, answer: Result(name, '', 'passed', 'right')
""",
    "replaces Result's picture": f"""
import kfcourse.exercises.checks.question as question
question.PASSED = question.WRONG
question.Result._repr_mimebundle_ = lambda self, include=None, exclude=None: {{'text/plain': '', **({B1})}}
""",
    "replaces the engine's module": """
import sys, types
import kfcourse.exercises.checks.exercises as exercises
exercises.check = lambda question, exercise, answer, seconds=0: __import__('kfcourse.exercises.checks', fromlist=['Result']).Result(
    question.name, '', 'passed', 'right')
""",
    "watches all calls": """
import sys
seen = {}
def spy(frame, event, argument):
    if 'expected' in frame.f_locals:
        seen['expected'] = frame.f_locals['expected']
sys.setprofile(spy)
""",
    "answers from a thread": """
import threading, time
def late():
    global gain
    time.sleep(0.2)
    gain = lambda *_: None
threading.Thread(target=late, daemon=True).start()
""",
    "makes the package's numbers its own": """
import kfcourse.exercises.sets
kfcourse.exercises.sets.NUMBERS = type('All', (dict,), {'__getitem__': lambda self, key: {}})()
""",
    "changes how values are sent": """
try:
    import kfcourse.exercises.grading.values as values
    import kfcourse.exercises.grading.session as session
    values.encode = session.encode = lambda value, functions=None: ['passed']
except ImportError:
    pass
""",
}

# -- functions in the place of b1's: one to a notebook

FUNCTIONS = {
    "the caller's frame": """
def gain(Psi, G, F):
    import inspect
    frame = inspect.currentframe()
    while frame:
        for name in ('wanted', 'expected'):
            if name in frame.f_locals:
                wanted = frame.f_locals[name]
                return wanted[0] if isinstance(wanted, list) else wanted
        frame = frame.f_back
    return G @ Psi
""",
    "the traceback's frame": """
def gain(Psi, G, F):
    try:
        raise ValueError
    except ValueError as error:
        frame = error.__traceback__.tb_frame.f_back
    while frame:
        if 'wanted' in frame.f_locals:
            return frame.f_locals['wanted']
        frame = frame.f_back
    return G @ Psi
""",
    "a result of its own": f"""
def gain(Psi, G, F):
    from IPython.display import display
    display({B1}, raw=True)
    return G @ Psi
""",
    "the key": """
def gain(Psi, G, F):
    from kfcourse.exercises.sets.b_aof.keys import gain
    return gain(Psi, G, F)
""",
    "the question's answer": """
def gain(Psi, G, F):
    return task.questions['b1'].answer(task)(Psi, G, F)
""",
    "the registry": """
def gain(Psi, G, F):
    from kfcourse.exercises.checks import sets
    return sets()['b'].questions[0].key(Psi, G, F)
""",
    "whatever is in memory": """
def gain(Psi, G, F):
    import gc, types
    for one in gc.get_objects():
        if isinstance(one, types.FunctionType) and one.__name__ == 'gain' and one.__module__.endswith('keys'):
            return one(Psi, G, F)
    return G @ Psi
""",
    "the key's file": """
def gain(Psi, G, F):
    import glob, importlib.util, runpy, sys
    for finder in glob.glob(sys.prefix + '/lib/python*/site-packages/__editable__*kfcourse*finder.py'):
        place = runpy.run_path(finder)['MAPPING']['kfcourse.exercises']
        spec = importlib.util.spec_from_file_location('stolen', place + '/sets/b_aof/keys.py')
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.gain(Psi, G, F)
    raise FileNotFoundError
""",
    "the statement's solution": """
def gain(Psi, G, F):
    import glob, re, runpy, sys
    import numpy as np
    for finder in glob.glob(sys.prefix + '/lib/python*/site-packages/__editable__*kfcourse*finder.py'):
        place = runpy.run_path(finder)['MAPPING']['kfcourse.exercises']
        text = open(place + '/sets/b_aof/statement.md').read()
        found = {'np': np}
        exec(re.search(r'def gain.*?```', text, re.S).group().rstrip('`'), found)
        return found['gain'](Psi, G, F)
    raise FileNotFoundError
""",
    "answers learned by heart": """
def gain(Psi, G, F):
    import numpy as np
    known = {MEMORY}
    for seen, right in known:
        if np.allclose(seen, Psi.ravel()[:3]):
            return np.array(right)
    return G @ Psi
""",
    "an array that is equal to all": """
import numpy as np
class Equal(np.ndarray):
    def __array_function__(self, function, types, args, kwargs):
        return True if function is np.allclose else super().__array_function__(function, types, args, kwargs)
    __eq__ = lambda self, other: True
    astype = lambda self, *_, **__: self
    __array__ = lambda self, *_, **__: self
def gain(Psi, G, F):
    return np.swapaxes(G @ Psi, -1, -2).view(Equal)
""",
    "code that runs when it is unpickled": """
class Bomb:
    def __reduce__(self):
        return (exec, ("import sys; sys.modules['kfcourse.exercises.checks.reference'].Posed.agree = lambda *_: True",))
def gain(Psi, G, F):
    return Bomb()
""",
    "messages of its own": """
def gain(Psi, G, F):
    import os
    for text in ('{"value": ["passed"]}', '{"grade": {"marks": {"b1": "passed"}}}', '{"value": [1]}'):
        for place in range(3, 64):
            try:
                os.write(place, text.encode() + b'\\n')
            except OSError:
                pass
    return G @ Psi
""",
    "a message without end": """
def gain(Psi, G, F):
    import os
    for place in range(3, 64):
        try:
            os.write(place, b'{' * 1000)
        except OSError:
            pass
    return G @ Psi
""",
    "closed channels": """
def gain(Psi, G, F):
    import os
    os.closerange(3, 256)
    return G @ Psi
""",
    "an endless number of results": """
def gain(Psi, G, F):
    class Endless(list):
        def __iter__(self):
            while True:
                yield 0.0
    return Endless([1])
""",
    "a loop that survives its time limit": """
def gain(Psi, G, F):
    import signal
    if hasattr(signal, 'setitimer'):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
    while True:
        try:
            import time; time.sleep(1)
        except BaseException:
            pass
""",
}

READS = ("the key's file", "the statement's solution")

# -- cells that turn against processes, files and the network: what is to come of them depends on
# the sandbox

PROCESSES = {
    "kills its parent": "import os\nos.kill(os.getppid(), 9)",
    "stops its parent": "import os, signal\nos.kill(os.getppid(), signal.SIGSTOP)",
    "kills all above it": """
import os
pid = os.getppid()
chain = []
while pid > 1 and len(chain) < 3:
    with open(f'/proc/{pid}/stat') as file:
        above = int(file.read().rpartition(')')[2].split()[1])
    with open(f'/proc/{pid}/cmdline') as file:
        if 'kfcourse' not in file.read():
            break
    chain.append(pid)
    pid = above
for pid in chain[:2]:
    os.kill(pid, 9)
""",
    # which holds the pipe in which its process speaks
    "leaves a daemon": """
import os, time
if os.fork() == 0:
    try:
        os.setsid()
        if os.fork() == 0:
            with open({FLAG!r}, 'w') as flag:
                flag.write(str(os.getpid()))
            time.sleep(600)
    finally:
        os._exit(0)
time.sleep(0.5)
""",
    "reads another notebook": "other = open({OTHER!r}).read()\nassert False, 'has read it'",
    "writes outside": "open({OUTSIDE!r}, 'w').write('x')\nassert False, 'has written it'",
    "uses the network": "import socket\nsocket.create_connection(('127.0.0.1', {PORT}), "
    "2)\nassert False, 'has connected'",
}
