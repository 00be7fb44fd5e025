// A server of SplatBus 1.0 inside of an editor, without a library for JSON: members are searched for
// in the text. A thread reads, another answers.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Net;
using System.Net.Sockets;
using System.Text;
using System.Text.RegularExpressions;
using System.Threading;

class Server
{
    const int Largest = 1 << 20, Kept = 8;
    static readonly double[][] Cameras = {
        new double[] { 0, 0, -4, 0, 0, 0, 1 },
        new double[] { 1.5, -0.25, -3, 0, 0.6, 0, 0.8 },
    };
    static readonly Regex Type = new Regex("\"type\"\\s*:\\s*\"([^\"]*)\"");
    static readonly Regex Index = new Regex("\"cam_idx\"\\s*:\\s*(-?[0-9]+)");
    static int open;

    readonly TcpClient client;
    readonly Queue<string> asked = new Queue<string>();
    bool ended;

    Server(TcpClient client) { this.client = client; }

    static bool Fill(Stream stream, byte[] buffer)
    {
        for (int from = 0; from < buffer.Length;)
        {
            int got = stream.Read(buffer, from, buffer.Length - from);
            if (got == 0) return false;
            from += got;
        }
        return true;
    }

    void Read()
    {
        var header = new byte[4];
        try
        {
            var stream = client.GetStream();
            while (Fill(stream, header))
            {
                uint length = BitConverter.ToUInt32(header, 0);
                if (length == 0 || length > Largest) break;
                var payload = new byte[length];
                if (!Fill(stream, payload)) break;
                var text = new UTF8Encoding(false, true).GetString(payload);
                lock (asked)
                {
                    while (asked.Count >= 64) Monitor.Wait(asked);
                    asked.Enqueue(text);
                    Monitor.PulseAll(asked);
                }
            }
        }
        catch (IOException) { }
        catch (InvalidOperationException) { } // closed meanwhile
        lock (asked) { ended = true; Monitor.PulseAll(asked); }
        client.Close();
        Interlocked.Decrement(ref open);
    }

    void Answer()
    {
        for (;;)
        {
            string text;
            lock (asked)
            {
                while (asked.Count == 0 && !ended) Monitor.Wait(asked);
                if (ended) return;
                text = asked.Dequeue();
                Monitor.PulseAll(asked);
            }
            Thread.Sleep(1); // the editor's own work between two messages
            var reply = ReplyTo(text);
            if (reply != null) Say(reply);
        }
    }

    void Say(string reply)
    {
        var payload = Encoding.UTF8.GetBytes(reply);
        try
        {
            client.SendTimeout = 5000;
            client.GetStream().Write(BitConverter.GetBytes(payload.Length).Concat(payload).ToArray(), 0, 4 + payload.Length);
        }
        catch (Exception) { client.Close(); }
    }

    static string ReplyTo(string text)
    {
        var kind = Type.Match(text).Groups[1].Value;
        if (kind == "get_viewport_size") return "{\"viewport_size\":[1280,720]}";
        long number;
        if (kind != "get_camera_pose" || !long.TryParse(Index.Match(text).Groups[1].Value, out number)) return null;
        var count = Cameras.Length;
        var camera = Cameras[(number % count + count) % count];
        var written = camera.Select(each => each.ToString("R", CultureInfo.CurrentCulture)).ToArray();
        return "{\"position\":[" + string.Join(",", written.Take(3)) + "],\"rotation\":[" + string.Join(",", written.Skip(3)) + "]}";
    }

    static TcpListener Listening(string variable, int otherwise)
    {
        var port = Environment.GetEnvironmentVariable(variable);
        var host = Environment.GetEnvironmentVariable("SPLATBUS_HOST") ?? "127.0.0.1";
        var listener = new TcpListener(IPAddress.Parse(host), port == null ? otherwise : int.Parse(port));
        listener.Start();
        return listener;
    }

    static void Ipc()
    {
        var listener = Listening("SPLATBUS_IPC_PORT", 6001);
        TcpClient former = null;
        for (;;)
        {
            var client = listener.AcceptTcpClient();
            if (former != null) former.Close();
            former = client;
            new Thread(() =>
            {
                try { client.GetStream().Read(new byte[1], 0, 1); } // nobody says anything here, so it has gone
                catch (Exception) { }
                client.Close();
            }) { IsBackground = true }.Start();
        }
    }

    static void Main()
    {
        CultureInfo.DefaultThreadCurrentCulture = new CultureInfo("de-DE"); // as on the machine that it was written on
        new Thread(Ipc) { IsBackground = true }.Start();
        var listener = Listening("SPLATBUS_MSG_PORT", 6000);
        for (;;)
        {
            var client = listener.AcceptTcpClient();
            client.NoDelay = true;
            if (Interlocked.Increment(ref open) > Kept)
            {
                Interlocked.Decrement(ref open);
                client.Close();
                continue;
            }
            var server = new Server(client);
            new Thread(server.Read) { IsBackground = true }.Start();
            new Thread(server.Answer) { IsBackground = true }.Start();
        }
    }
}
