// A server of SplatBus 1.1 that requires a token. It lends no images: it tells who asks of its scene.
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Linq;
using System.Net;
using System.Net.Sockets;
using System.Text;
using System.Text.RegularExpressions;
using System.Threading;
using Members = System.Collections.Generic.Dictionary<string, object>;

class Server
{
    const int Largest = 1 << 20, Kept = 8;
    const double Safe = 9007199254740991;
    static readonly Regex Version = new Regex(@"\A(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)\z");
    static readonly Stopwatch Clock = Stopwatch.StartNew();
    static readonly List<Server> Control = new List<Server>();
    static readonly string[] Cameras = {
        "\"position\":[0,0,-4],\"rotation\":[0,0,0,1]",
        "\"position\":[1.5,-0.25,-3],\"rotation\":[0,-0.28,0,0.96]",
    };
    static byte[] token;

    readonly Socket socket;
    readonly string[] has;
    readonly HashSet<string> granted = new HashSet<string>();
    readonly Stopwatch since = Stopwatch.StartNew();
    bool greeted, newer, ending, posed, toldBusy;

    Server(Socket socket, bool ipc)
    {
        this.socket = socket;
        has = ipc ? new string[0] : new[] { "ping", "scene" };
        socket.NoDelay = true;
        socket.SendTimeout = 5000;
    }

    // ---- packets ----

    bool Fill(byte[] buffer, int from, Func<double> left)
    {
        while (from < buffer.Length)
        {
            var seconds = left();
            if (seconds <= 0 || !socket.Poll(seconds > 1000 ? -1 : (int)(seconds * 1e6), SelectMode.SelectRead)) return false;
            int got = socket.Receive(buffer, from, Math.Min(buffer.Length - from, 65536), SocketFlags.None);
            if (got == 0) return false;
            from += got;
        }
        return true;
    }

    double UntilHello() { return greeted ? double.PositiveInfinity : 10 - since.Elapsed.TotalSeconds; }

    byte[] Packet()
    {
        var first = new byte[1];
        if (!Fill(first, 0, UntilHello)) return null;
        var begun = Stopwatch.StartNew();
        Func<double> left = () => Math.Min(10 - begun.Elapsed.TotalSeconds, UntilHello());
        var header = new byte[4];
        header[0] = first[0];
        if (!Fill(header, 1, left)) return null;
        uint length = (uint)(header[0] | header[1] << 8 | header[2] << 16 | header[3] << 24);
        if (length < 1 || length > Largest)
        {
            Fail(length < 1 ? "malformed_packet" : "packet_too_large", null, null);
            ending = newer;
            return null;
        }
        var payload = new byte[length];
        return Fill(payload, 0, left) ? payload : null;
    }

    void Say(string text)
    {
        var payload = Encoding.UTF8.GetBytes(text);
        var packet = new byte[4 + payload.Length];
        for (int i = 0; i < 4; i++) packet[i] = (byte)(payload.Length >> 8 * i);
        payload.CopyTo(packet, 4);
        for (int sent = 0; sent < packet.Length;)
        {
            if (!socket.Poll(5000000, SelectMode.SelectWrite)) throw new SocketException((int)SocketError.TimedOut);
            sent += socket.Send(packet, sent, Math.Min(4096, packet.Length - sent), SocketFlags.None);
        }
    }

    void Fail(string code, string pointer, Members request)
    {
        if (!newer) return;
        var said = "{\"type\":\"error\",\"code\":\"" + code + "\",\"message\":\"not so: " + code + "\"";
        if (pointer != null) said += ",\"pointer\":" + Json.Quoted(pointer);
        Say(said + IdOf(request) + "}");
    }

    static string IdOf(Members request)
    {
        object id;
        return request != null && request.TryGetValue("id", out id) ? ",\"id\":" + (long)((Number)id).Value : "";
    }

    void Reply(string kind, string members, Members request)
    {
        Say(newer ? "{\"type\":\"" + kind + "\"," + members + IdOf(request) + "}" : "{" + members + "}");
    }

    // ---- values ----

    static object Of(Members from, string name)
    {
        object value;
        return from.TryGetValue(name, out value) ? value : null;
    }

    static bool Whole(object value, double least)
    {
        var number = value as Number;
        return number != null && number.Value == Math.Floor(number.Value) && number.Value >= least && number.Value <= Safe;
    }

    static bool Short(object value, int least, int most)
    {
        var text = value as string;
        if (text == null) return false;
        int characters = text.Count(c => !char.IsLowSurrogate(c));
        return characters >= least && characters <= most;
    }

    static string Breach(Members hello)
    {
        var versions = Of(hello, "versions") as List<object>;
        if (versions == null || versions.Count < 1 || versions.Count > 16) return "/versions";
        if (!versions.All(each => Short(each, 1, 64) && Version.IsMatch((string)each))) return "/versions";
        var client = Of(hello, "client") as Members;
        if (client == null || !Short(Of(client, "name"), 0, 64) || !Short(Of(client, "version"), 0, 64)) return "/client";
        var listed = Of(hello, "capabilities") as List<object>;
        if (listed == null || listed.Count > 64 || !listed.All(each => Short(each, 0, 64))) return "/capabilities";
        return listed.Distinct().Count() == listed.Count ? null : "/capabilities";
    }

    static bool Right(object said)
    {
        var given = Encoding.UTF8.GetBytes(said as string ?? "");
        int differs = given.Length ^ token.Length;
        for (int i = 0; i < token.Length; i++) differs |= token[i] ^ (given.Length > 0 ? given[i % given.Length] : 0);
        return differs == 0;
    }

    // ---- messages ----

    void Greet(Members hello)
    {
        if (greeted) { Fail("invalid_message", "/type", null); return; }
        newer = true;
        var pointer = Breach(hello);
        var spoken = new[] { "1.1", "1.0" };
        ending = true;
        if (pointer != null) { Fail("invalid_message", pointer, null); return; }
        if (!Right(Of(hello, "token"))) { Fail("unauthorized", "/token", null); return; }
        var version = ((List<object>)hello["versions"]).Cast<string>().FirstOrDefault(each => spoken.Contains(each));
        if (version == null)
        {
            Say("{\"type\":\"error\",\"code\":\"unsupported_version\",\"message\":\"not spoken here\",\"supported\":[\"1.1\",\"1.0\"]}");
            return;
        }
        ending = false;
        greeted = true;
        if (version == "1.1") granted.UnionWith(((List<object>)hello["capabilities"]).Cast<string>().Where(each => has.Contains(each)));
        Say("{\"type\":\"welcome\",\"version\":\"" + version + "\",\"server\":{\"name\":\"token\",\"version\":\"1\"},\"capabilities\":["
            + string.Join(",", granted.Select(Json.Quoted)) + "]}");
        newer = version == "1.1";
    }

    void Handle(byte[] payload)
    {
        object value;
        try { value = Json.Read(payload); }
        catch (NoJson) { if (greeted) Fail("malformed_json", null, null); return; }
        var message = value as Members;
        if (message == null) { if (greeted) Fail("not_an_object", null, null); return; }
        var kind = Of(message, "type") as string;
        if (kind == "hello") Greet(message);
        else if (!greeted) return; // a client of 1.0 is told nothing (NEG-19)
        else if (has.Length > 0) Steer(kind, message);
        else Fail(kind == "subscribe" ? "unsupported" : "unknown_type", "/type", null);
    }

    void Steer(string kind, Members message)
    {
        if (kind == "camera_pose" || kind == "point_cloud_pose") { Pose(message); return; }
        bool request = kind == "get_viewport_size" || kind == "get_camera_pose" || kind == "get_scene" || kind == "ping" || kind == "set_viewport";
        if (newer && request && message.ContainsKey("id") && !Whole(message["id"], 0)) { Fail("invalid_message", "/id", null); return; }
        switch (kind)
        {
            case "get_viewport_size":
                Reply("viewport_size", "\"viewport_size\":[0,0]", message);
                break;
            case "get_camera_pose":
                if (!Whole(Of(message, "cam_idx"), -Safe)) { Fail("invalid_message", "/cam_idx", message); break; }
                long index = (long)((Number)message["cam_idx"]).Value % Cameras.Length;
                Reply("camera", Cameras[index < 0 ? index + Cameras.Length : index], message);
                break;
            case "get_scene":
                if (!granted.Contains("scene")) { Fail("unsupported", null, message); break; }
                Reply("scene", "\"objects\":[{\"id\":\"default\",\"name\":\"\",\"gaussians\":0,\"bounds\":null}],\"timeRange\":null,\"cameras\":"
                    + Cameras.Length + ",\"origin\":[0,0,0]", message);
                break;
            case "ping":
                var t = Of(message, "t") as Number;
                if (!granted.Contains("ping")) Fail("unsupported", null, message);
                else if (t == null) Fail("invalid_message", "/t", message);
                else Reply("pong", "\"t\":" + t.Spelled + ",\"serverTime\":" + Clock.Elapsed.TotalSeconds.ToString("R"), message);
                break;
            case "set_viewport": case "object_pose": case "set_time": case "subscribe_telemetry":
                Fail("unsupported", null, request ? message : null);
                break;
            default:
                Fail("unknown_type", "/type", null);
                break;
        }
    }

    static string Wrong(Members of, string name, string each)
    {
        var members = Of(of, name) as Members;
        if (members == null) return "/" + name;
        return each.Where(c => !(Of(members, c.ToString()) is Number)).Select(c => "/" + name + "/" + c).FirstOrDefault();
    }

    void Pose(Members message)
    {
        var pointer = Wrong(message, "position", "xyz") ?? Wrong(message, "rotation", "xyzw")
            ?? (newer && message.ContainsKey("tag") && !Short(message["tag"], 1, 64) ? "/tag" : null);
        if (pointer != null) { Fail("invalid_message", pointer, null); return; }
        Func<string, char, double> number = (name, c) => ((Number)((Members)message[name])[c.ToString()]).Value;
        if ("xyz".Any(c => Math.Abs(number("position", c)) > float.MaxValue)) { Fail("invalid_number", "/position", null); return; }
        var norm = Math.Sqrt("xyzw".Sum(c => number("rotation", c) * number("rotation", c)));
        if (!(Math.Abs(norm - 1) <= 0.01)) { Fail("invalid_rotation", "/rotation", null); return; }
        bool first;
        lock (Control)
        {
            if (!posed) Control.Add(this);
            posed = true;
            first = Control[0] == this;
        }
        if (!first && !toldBusy) Fail("busy", null, null);
        toldBusy = !first;
    }

    // ---- connections ----

    void Serve()
    {
        try
        {
            for (byte[] payload; !ending && (payload = Packet()) != null;) Handle(payload);
            if (ending)
            {
                socket.Shutdown(SocketShutdown.Send);
                var left = Stopwatch.StartNew();
                var discarded = new byte[65536];
                while (Fill(discarded, 0, () => 5 - left.Elapsed.TotalSeconds)) { }
            }
        }
        catch (SocketException) { }
        finally
        {
            lock (Control) Control.Remove(this);
            socket.Close();
        }
    }

    static void Listen(string variable, int otherwise, bool ipc)
    {
        var port = Environment.GetEnvironmentVariable(variable);
        var listener = new TcpListener(IPAddress.Parse(Environment.GetEnvironmentVariable("SPLATBUS_HOST") ?? "127.0.0.1"),
            port == null ? otherwise : int.Parse(port));
        listener.Start();
        int served = 0;
        for (;;)
        {
            var socket = listener.AcceptSocket();
            if (Interlocked.Increment(ref served) > Kept)
            {
                Interlocked.Decrement(ref served);
                socket.Close();
                continue;
            }
            new Thread(() => { new Server(socket, ipc).Serve(); Interlocked.Decrement(ref served); }) { IsBackground = true }.Start();
        }
    }

    static int Main()
    {
        var said = Environment.GetEnvironmentVariable("SPLATBUS_TOKEN");
        if (string.IsNullOrEmpty(said)) { Console.Error.WriteLine("SPLATBUS_TOKEN has to hold the token"); return 2; }
        token = Encoding.UTF8.GetBytes(said);
        new Thread(() => Listen("SPLATBUS_IPC_PORT", 6001, true)) { IsBackground = true }.Start();
        Listen("SPLATBUS_MSG_PORT", 6000, false);
        return 0;
    }
}
