"""A nodelet manager in a process of its own, into which a test loads nodelets by its services."""

import os
import tempfile

import genmsg
import genpy.dynamic
import rospkg
import rospy

from node_testing import program, start_child


def service(name):
    """The class of a service of the package nodelet, by its definition: Debian has its Python code in a package of its
    own."""
    context = genmsg.MsgContext.create_default()
    path = os.path.join(rospkg.RosPack().get_path("nodelet"), "srv", name + ".srv")
    spec = genmsg.msg_loader.load_srv_from_file(context, path, f"nodelet/{name}")
    halves = {}
    for half, part in (("_request_class", spec.request), ("_response_class", spec.response)):
        halves[half] = genpy.dynamic.generate_dynamic(part.full_name, part.text or "\n")[part.full_name]
    return type(name, (), dict(halves, _type=f"nodelet/{name}", _md5sum=genmsg.compute_md5(context, spec)))


class NodeletManager:
    """`name` is its node's name. What it prints begins with its severity in brackets."""

    def __init__(self, name="manager"):
        self.log = tempfile.NamedTemporaryFile(suffix=".log")
        self.process = start_child([program("nodelet", "nodelet"), "manager", f"__name:={name}"], stdout=self.log,
                                   stderr=self.log, env=dict(os.environ, ROSCONSOLE_FORMAT="[${severity}] ${message}"))
        rospy.wait_for_service(f"/{name}/load_nodelet", 60)
        self.services = {each: rospy.ServiceProxy(f"/{name}/{each}", service(kind)) for each, kind in (
            ("load_nodelet", "NodeletLoad"), ("unload_nodelet", "NodeletUnload"), ("list", "NodeletList"))}

    def load(self, name, node, parameters, remap=None):
        """Whether the nodelet `/name` of the class of `node` (such as edge_vo) loads with these parameters."""
        if rospy.has_param(f"/{name}"):
            rospy.delete_param(f"/{name}")
        if parameters:
            rospy.set_param(f"/{name}", parameters)
        kind = "livemap/" + "".join(word.capitalize() for word in node.split("_")) + "Nodelet"
        remap = remap or {}
        try:
            return self.services["load_nodelet"](f"/{name}", kind, list(remap), list(remap.values()), [], "").success
        except rospy.ServiceException:
            return False

    def unload(self, name):
        return self.services["unload_nodelet"](f"/{name}").success

    def names(self):
        return set(self.services["list"]().nodelets)

    def is_alive(self):
        return self.process.poll() is None

    def output(self):
        with open(self.log.name, encoding="utf-8", errors="replace") as file:
            return file.read()

    def stop(self):
        self.process.terminate()
        self.process.wait()
        self.log.close()
