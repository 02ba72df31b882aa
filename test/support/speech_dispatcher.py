"""A real speech-dispatcher of a test's own, and sound devices of ALSA that are files or are not there."""

import os
import shutil
import tempfile
import time

from node_testing import eventually, start_child

# $DATA may stand only once in a command.
SPOKEN = r"""GenericExecuteSynth "begun=\'$DATA\'; printf \'begin %s\\n\' \"$begun\" >> FILE; sleep SECONDS; \
printf \'end %s\\n\' \"$begun\" >> FILE"
GenericDelimiters "."
GenericMaxChunkLength 500
DefaultVoice "any"
"""


class SpeechDispatcher:
    """`said` has what it began and ended to say, a sentence of `seconds` each; it makes no sound. With `synthesizer`
    it is espeak-ng instead, whose sound goes to ALSA."""

    def __init__(self, seconds=0.5, synthesizer=False):
        self.folder = tempfile.mkdtemp(prefix="livemap_speech_")
        self.file = os.path.join(self.folder, "said")
        modules = os.path.join(self.folder, "modules")
        os.makedirs(modules)
        with open(os.path.join(self.folder, "speechd.conf"), "w", encoding="utf-8") as config:
            config.write('LogLevel 3\nTimeout 0\nAudioOutputMethod "alsa"\nAudioALSADevice "default"\n')
            if synthesizer:
                config.write('AddModule "espeak-ng" "sd_espeak-ng" "espeak-ng.conf"\nDefaultModule espeak-ng\n')
            else:
                config.write('AddModule "file" "sd_generic" "file.conf"\nDefaultModule file\n')
        with open(os.path.join(modules, "file.conf"), "w", encoding="utf-8") as module:
            module.write(SPOKEN.replace("FILE", self.file).replace("SECONDS", str(seconds)))
            for language in ("en", "de", "pt"):
                module.write(f'GenericLanguage "{language}" "{language}" "utf-8"\n')
                module.write(f'AddVoice "{language}" "MALE1" "any"\n')
        with open(os.path.join(modules, "espeak-ng.conf"), "w", encoding="utf-8"):
            pass  # Its defaults.
        socket = os.path.join(self.folder, "socket")
        self.process = start_child(["speech-dispatcher", "--run-single", "--config-dir", self.folder, "--log-dir",
                                    self.folder, "--pid-file", os.path.join(self.folder, "pid"),
                                    "--communication-method", "unix_socket", "--socket-path", socket])
        eventually(lambda: os.path.exists(socket), "speech-dispatcher listens")
        time.sleep(0.5)  # It listens before its modules are loaded.
        self.address = f"unix_socket:{socket}"

    def said(self):
        if not os.path.exists(self.file):
            return []
        with open(self.file, encoding="utf-8") as file:
            return [line for line in file.read().splitlines() if line.split(" ", 1)[1].strip() != "1"]

    def stop(self):
        self.process.terminate()
        self.process.wait()
        shutil.rmtree(self.folder)


def alsa_config(folder, output=None):
    """Path of a configuration whose sound device writes the file `output`, or is not there."""
    path = os.path.join(folder, "asound.conf")
    with open(path, "w", encoding="utf-8") as file:
        if output:
            file.write('pcm.!default { type file file "%s" format "raw" slave.pcm "nowhere" }\n' % output)
            file.write("pcm.nowhere { type null }\n")
        else:
            file.write("pcm.!default { type hw card 31 }\n")
    return path
